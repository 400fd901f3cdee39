"""Matching of photos to walls, from the stated position and the photo's own content.

The rectification of a photo gives the camera's angle to the wall, so that each candidate wall implies a camera heading.
Rays through the photo's middle start at positions sampled around the stated one. The likelihood of a wall is the share
of rays that hit it, weighted by the agreement of the heading with the stated one and of the roof's height with the
photo.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, IntArray, UInt8Array
from facade_core.geometry.scene import Scene
from facade_core.imagery.poses.settings import PHOTO_MATCHING
from facade_core.parsing.segmenter import facade_surroundings_mask


@dataclass(frozen=True, slots=True)
class PhotoOrientation:
    """Orientation of the camera relative to the wall of a rectified photo.

    Attributes
    ----------
    ahead : (2,) unit direction of the photo's middle on the ground: along the wall to the right, and into it.
    roof_slope : height of the roof's edge above the camera over the camera's distance; None where it is not seen.
    """

    ahead: Float64Array
    roof_slope: float | None


@dataclass(frozen=True, slots=True)
class WallLikelihoods:
    """Likelihood that a photo's middle shows each of n walls, with its evidence.

    Attributes
    ----------
    probability : (n,) sums to less than 1, as the photo may show none of them.
    hit_share : (n,) share of the sampled positions whose ray through the photo's middle hits the wall.
    heading_offset_deg : (n,) implied heading minus the stated one, NaN without a stated one.
    roof_height_m : (n,) height above the ground at which the photo has its roof; NaN where it is not seen or not hit.
    """

    probability: Float64Array
    hit_share: Float64Array
    heading_offset_deg: Float64Array
    roof_height_m: Float64Array


def estimate_orientation(
    image: UInt8Array, seen: BoolArray, homography: Float64Array, focal: float, size: tuple[int, int]
) -> PhotoOrientation:
    """Estimate the camera's orientation from a rectified photo; the principal point is the photo's centre.

    Parameters
    ----------
    image : (H, W, 3) uint8, the rectified photo.
    seen : (H, W) bool, pixels that the photo covers.
    homography : (3, 3) from photo pixels to the pixels of `image`.
    focal : focal length in photo pixels.
    size : height and width of the photo.
    """
    rotation, camera = camera_from_homography(homography, focal, size)
    across, _, into = rotation[2]  # optical axis of the camera in the plane's frame
    ahead = np.array([across, into]) / max(float(np.hypot(across, into)), 1e-9)
    middle = camera[0] + camera[2] * across / into if into > 0.1 else np.nan
    return PhotoOrientation(ahead, _roof_slope(image, seen, middle, camera))


def camera_from_homography(
    homography: Float64Array, focal: float, size: tuple[int, int]
) -> tuple[Float64Array, Float64Array]:
    """Compute the pose of the camera relative to the plane that a homography rectifies.

    Parameters
    ----------
    homography : (3, 3) from photo pixels to plane pixels.
    focal : focal length in photo pixels.
    size : height and width of the photo.

    Returns
    -------
    Rotation (3, 3) from the plane's axes (x right, y down, z into it) to the camera's, and the camera's position (3,)
    in plane pixels, whose third component is its distance.
    """
    height, width = size
    intrinsic = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])
    columns = np.linalg.solve(intrinsic, np.linalg.inv(homography))
    columns /= np.linalg.norm(columns[:, :2], axis=0).mean()
    if columns[2, 2] < 0:  # the plane must be in front of the camera
        columns = -columns
    # nearest rotation to three almost orthogonal columns
    u, _, v = np.linalg.svd(np.column_stack([columns[:, 0], columns[:, 1], np.cross(columns[:, 0], columns[:, 1])]))
    rotation = u @ v
    x, y, z = -rotation.T @ columns[:, 2]
    return rotation, np.array([x, y, -z])


def _roof_slope(image: UInt8Array, seen: BoolArray, middle: float, camera: Float64Array) -> float | None:
    """Height of the roof's edge above the camera over the camera's distance, near a column of a rectified photo."""
    if not 0 <= middle < seen.shape[1]:
        return None
    half = max(2, round(PHOTO_MATCHING.roof_columns_share / 2 * seen.shape[1]))
    part = np.s_[:, max(int(middle) - half, 0) : int(middle) + half]
    wall = seen[part] & ~facade_surroundings_mask(image, ~seen)[part]
    top = np.argmax(wall, axis=0)
    sky = wall.any(axis=0) & (np.take_along_axis(seen[part], np.maximum(top - 3, 0)[None], 0)[0]) & (top > 3)
    if sky.mean() < PHOTO_MATCHING.min_sky_share:
        return None
    return float((camera[1] - np.median(top[sky])) / camera[2])


def match_walls(
    scene: Scene,
    walls: IntArray,
    orientation: PhotoOrientation,
    place: Float64Array,
    heading: float | None,
    *,
    seed: int,
) -> WallLikelihoods:
    """Compute the likelihood of each wall that a photo's middle shows it.

    Parameters
    ----------
    scene : scene that contains the walls.
    walls : (n,) charts.
    orientation : camera orientation from the photo.
    place : (3,) stated position on the ground in metres.
    heading : stated heading in degrees clockwise from the frame's north, None without.
    seed : random seed of the sampled positions.
    """
    charts = scene.charts
    normal, right = charts.normals()[walls], charts.axis_u[walls]
    foot = charts.points_at_shares(walls, np.array([[0.5, 1.0]]))[:, 0]
    direction = orientation.ahead[0] * right - orientation.ahead[1] * normal
    direction[:, 2] = 0.0
    distance = np.linalg.norm((foot - place)[:, :2], axis=1) - charts.size[walls, 0] / 2
    candidates = np.flatnonzero(
        (distance < PHOTO_MATCHING.max_wall_distance_m)
        & (np.einsum("ij,ij->i", place - foot, normal) > -3 * PHOTO_MATCHING.position_sigma_m)
        & (orientation.ahead[1] > np.cos(np.radians(PHOTO_MATCHING.max_obliquity_deg)))
    )
    offsets = np.random.default_rng(seed).normal(
        0, PHOTO_MATCHING.position_sigma_m, (PHOTO_MATCHING.position_samples, 2)
    )
    origin = np.column_stack(
        [place[:2] + offsets, np.full(PHOTO_MATCHING.position_samples, place[2] + PHOTO_MATCHING.ray_height_m)]
    )
    likelihood, hit_shares = np.zeros(len(walls)), np.zeros(len(walls))
    heading_offsets, roof_heights = np.full(len(walls), np.nan), np.full(len(walls), np.nan)
    for i in candidates.tolist():
        ray_length, met_chart = scene.caster.cast(origin, np.broadcast_to(direction[i], origin.shape))
        is_hit = (met_chart == walls[i]) & (ray_length < PHOTO_MATCHING.max_wall_distance_m)
        hit_shares[i] = is_hit.mean()
        weight = is_hit.astype(float)
        if orientation.roof_slope is not None:
            wall_distance = np.where(is_hit, ray_length, 1.0) * orientation.ahead[1]
            roof_above_camera = charts.size[walls[i], 1] - PHOTO_MATCHING.camera_height_m
            weight *= np.exp(
                -(
                    (
                        np.log(max(roof_above_camera, 0.5) / np.maximum(orientation.roof_slope * wall_distance, 0.5))
                        / PHOTO_MATCHING.roof_log_sigma
                    )
                    ** 2
                )
                / 2
            )
            roof_heights[i] = (
                PHOTO_MATCHING.camera_height_m + orientation.roof_slope * np.median(wall_distance[is_hit])
                if is_hit.any()
                else np.nan
            )
        likelihood[i] = weight.mean()
        if heading is not None:
            difference = (np.degrees(np.arctan2(direction[i, 0], direction[i, 1])) - heading + 180) % 360 - 180
            likelihood[i] *= (1 - PHOTO_MATCHING.wrong_heading_share) * np.exp(
                -((difference / PHOTO_MATCHING.heading_sigma_deg) ** 2) / 2
            ) + PHOTO_MATCHING.wrong_heading_share
            heading_offsets[i] = difference
    return WallLikelihoods(
        likelihood / (likelihood.sum() + PHOTO_MATCHING.no_wall_weight), hit_shares, heading_offsets, roof_heights
    )
