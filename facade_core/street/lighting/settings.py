"""Settings of light: tuned numbers, one class per step."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class AmbientSettings:
    """Light of the sky and of surfaces around.

    Attributes
    ----------
    ambient_cell_m : spacing of the places that light is traced for, which include the border; light is linear between
        them.
    rays_per_place : paths that start at a place.
    occluder_range_m : beyond this distance rays see haze: as bright as the sky above the horizon, as the ground below
        it.
    last_light : light of surfaces at the second reflection, as a share of the open sky's.
    noise : standard deviation of the light that a single ray brings.
    denoising_rounds : rounds of the filter; each reaches one place farther.
    places_per_batch : places whose rays are cast at once.
    """

    ambient_cell_m: float = 0.5
    rays_per_place: int = 16
    occluder_range_m: float = 40.0
    last_light: float = 0.4
    noise: float = 0.5
    denoising_rounds: int = 3
    places_per_batch: int = 1 << 13


AMBIENT = AmbientSettings()


@dataclass(frozen=True, slots=True)
class SkySettings:
    """Sky behind buildings.

    Attributes
    ----------
    haze_m : at this distance two thirds of a colour are the horizon's.
    rooflines : rows of roofs around the horizon, the farther first: number of houses, tangent of the lowest roof,
        range of the tangents, share of haze.
    roofline_blur : softness of edges (tangent).
    max_wall_drop : distance of the walls below the horizon (tangent), where the block's ground ends.
    """

    haze_m: float = 1500.0
    rooflines: tuple[tuple[int, float, float, float], tuple[int, float, float, float]] = (
        (151, 0.050, 0.035, 0.66),
        (89, 0.026, 0.040, 0.42),
    )
    roofline_blur: float = 0.0025
    max_wall_drop: float = 0.014


SKY_LOOK = SkySettings()


@dataclass(frozen=True, slots=True)
class SunSettings:
    """Light of the sun.

    Attributes
    ----------
    exposure : exposure with a sun, relative to that under an overcast sky.
    disk_radius_deg, disk_rays : six times the sun's own radius, as through thin haze.
    rim_rays : the outermost of these, which are cast first.
    sun_cell_m : spacing of the ray origins; light is linear between them.
    ray_lift_m : distance of ray origins from the surface.
    max_shadow_reach_m : occluders beyond this distance cast no shadow.
    ray_batch : rays per cast.
    """

    exposure: float = 0.5
    disk_radius_deg: float = 1.6
    disk_rays: int = 9
    rim_rays: int = 3
    sun_cell_m: float = 0.25
    ray_lift_m: float = 0.04
    max_shadow_reach_m: float = 150.0
    ray_batch: int = 1 << 19


SUNLIGHT = SunSettings()


@dataclass(frozen=True, slots=True)
class ToneCurveSettings:
    """Tone curve of a camera: blacks and whites as in photographs.

    Attributes
    ----------
    pivot : brightness that stays, as a share of white.
    contrast : exponent of the tones below it, and slope at it.
    saturation : factor of the difference of a colour from its grey.
    """

    pivot: float = 0.44
    contrast: float = 1.55
    saturation: float = 1.3


TONE_CURVE = ToneCurveSettings()
