"""Settings of factored models, which repeat the pictures of units, grains and mouldings."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class UnitSettings:
    """Numbers of units and their surrounds.

    Attributes
    ----------
    max_unit_width_m : maximum width of a unit of balcony and openings, metres.
    max_gap_m : maximum gap between the elements of a unit, metres.
    max_reach_m : maximum reach of a surround beyond its element, metres.
    min_reach_m : minimum reach of a surround, metres.
    min_different_share : minimum share of different pixels in a line of a surround.
    min_grey_difference : minimum difference of such a pixel from the wall, grey levels.
    """

    max_unit_width_m: float = 4.5
    max_gap_m: float = 0.12
    max_reach_m: float = 0.6
    min_reach_m: float = 0.06
    min_different_share: float = 0.3
    min_grey_difference: float = 14.0


FACADE_UNITS = UnitSettings()


@dataclass(frozen=True, slots=True)
class GrainSettings:
    """Numbers of grains and their similarity.

    Attributes
    ----------
    texture_sides_px : sides of grain textures, pixels.
    repeat_m : desired period of the texture on the wall, metres.
    block_sides_px : block sides for the largest texture, pixels; the largest with enough places is used.
    min_block_px : minimum side of a block, pixels.
    min_block_count : minimum number of places for blocks of a size.
    max_blocks_tried : maximum number of candidate blocks.
    max_error_factor : a block is drawn among those with an error up to this factor of the least.
    shade_m : larger structures are shade, not grain, metres.
    max_contrast : maximum factor of grain to its mean light, in both directions.
    octave_borders : octave borders of the descriptor, cycles per metre; the finest are visible at 32 pixels per
        metre.
    directions : directions of the descriptor.
    min_grain_distance : distance up to which grains are similar, in square roots of relative light.
    max_distance_share : distance up to which grains are similar, as share of the weaker grain's contrast.
    evenness_parts : parts per side whose contrast is compared to measure evenness.
    """

    texture_sides_px: tuple[int, int, int] = (64, 128, 256)
    repeat_m: float = 4.0
    block_sides_px: tuple[int, ...] = (80, 64, 48, 32, 24, 16)
    min_block_px: int = 12
    min_block_count: int = 24
    max_blocks_tried: int = 320
    max_error_factor: float = 1.1
    shade_m: float = 0.45
    max_contrast: float = 3.0
    octave_borders: tuple[float, ...] = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
    directions: int = 4
    min_grain_distance: float = 0.012
    max_distance_share: float = 0.25
    evenness_parts: int = 8


WALL_GRAINS = GrainSettings()


@dataclass(frozen=True, slots=True)
class LibrarySettings:
    """Numbers of libraries of pictures.

    Attributes
    ----------
    descriptor_side_px : side of a unit descriptor, pixels.
    max_aspect_ratio : maximum ratio between the aspect ratios of similar units.
    wall_light_weight : grey levels per unit of difference between the wall light around two units, in square
        roots.
    fade_m : length over which the end of a moulding fades into its start, metres.
    max_moulding_m : maximum length of a moulding texture, metres.
    min_moulding_m : minimum length of a moulding texture, metres; shorter runs become one averaged column.
    max_material_difference : maximum difference of one material, in square roots of light.
    wall_smoothing_m : smoothing of the wall light around units, metres.
    """

    descriptor_side_px: int = 16
    max_aspect_ratio: float = 1.6
    wall_light_weight: float = 150.0
    fade_m: float = 0.3
    max_moulding_m: float = 4.0
    min_moulding_m: float = 0.6
    max_material_difference: float = 0.07
    wall_smoothing_m: float = 0.35


LIBRARIES = LibrarySettings()


@dataclass(frozen=True, slots=True)
class WallSettings:
    """Numbers of factored walls.

    Attributes
    ----------
    shade_smoothing_m : smoothing of the light on a wall, metres.
    reveal_light : light on reveals relative to the wall.
    max_light_factor : maximum factor on the picture of an element, so that a wrong type does not glare.
    min_light_factor : minimum factor on the picture of an element, so that a wrong type is not a black window.
    max_off_wall_plane_m : maximum distance of a wall's corners from its plane, metres; other walls stay as they
        are.
    min_recess_pixels : recesses appear once their depth covers this many pixels.
    """

    shade_smoothing_m: float = 0.4
    reveal_light: float = 0.7
    max_light_factor: float = 2.0
    min_light_factor: float = 0.4
    max_off_wall_plane_m: float = 0.02
    min_recess_pixels: float = 2.0


FACTORED_WALLS = WallSettings()


@dataclass(frozen=True, slots=True)
class UnfactoredSettings:
    """Numbers of charts that are not factored.

    Attributes
    ----------
    ground_share : share of the texel density that ground charts keep; densities already fall with distance.
    max_ground_density : maximum density of ground charts, texels per metre.
    unfactored_share : share of the texel density that roofs and party walls keep.
    max_unfactored_density : maximum density of roofs and party walls, texels per metre.
    min_density : minimum density, texels per metre.
    """

    ground_share: float = 0.375
    max_ground_density: float = 8.0
    unfactored_share: float = 0.25
    max_unfactored_density: float = 4.0
    min_density: float = 2.0


UNFACTORED = UnfactoredSettings()
