"""Which wall of a block a photo shows, by where it says it was taken and what it shows by itself.

A rectified photo says how the camera was turned off the wall before it, so that each wall tells whither the camera looked. From
places around the stated one a ray goes through the middle of the photo: a wall is as likely as it is met, as the heading agrees
with the stated one, and as its roof stands where the photo has it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facade_core.geometry.scene import Scene
from facade_core.parsing.segmenter import outside_mask

# Metres over the ground at which people hold cameras, and at which they look for the wall: over cars, under balconies.
EYE_M, LOOK_M = 1.65, 2.5
# How far a stated place is off (a spread each way, metres) and a stated heading (degrees), and how often that is quite wrong.
PLACE_M, HEADING_DEG, LYING = 5.0, 20.0, 0.02
# Spread of the logarithm of a roof's height as the photo has it.
ROOF = 0.15
# That a photo shows none of the walls is as likely as that this share of the rays meets one whose roof is where it has it.
ELSEWHERE = 0.005
# Walls are looked for from so many places, no farther than REACH_M; of one that is met farther from its normal, degrees, a
# photo shows nothing of use.
PLACES, REACH_M, GRAZING_DEG = 256, 60.0, 70.0
# The share of a photo's columns around its middle at which the roof is looked for, and of those that must show sky above it.
COLUMNS, SKY = 0.06, 0.5


@dataclass(frozen=True, slots=True)
class PhotoOrientation:
    """What a rectified photo tells.

    Args:
        ahead: (2,) where the photo's middle points, in the plane of ground: along the wall to the right, and into it; unit.
        roof: height of the roof's edge over the camera, by the camera's distance from the wall; None where it is not seen.
    """

    ahead: np.ndarray
    roof_slope: float | None


@dataclass(frozen=True, slots=True)
class WallLikelihoods:
    """Of walls, how likely it is that a photo's middle shows each, and what speaks for it.

    Args:
        likely: (n,) they sum to less than 1, as it may show none.
        met: (n,) the share of the tried places from which the ray through the photo's middle meets it.
        turned: (n,) degrees from the stated heading to that of a camera that sees it so; NaN where none is stated.
        roof: (n,) metres over the ground at which the photo has its roof; NaN where that is not seen, or it is not met.
    """

    probability: np.ndarray
    hit_share: np.ndarray
    heading_offset_deg: np.ndarray
    roof_height_m: np.ndarray


def estimate_orientation(image: np.ndarray, seen: np.ndarray, homography: np.ndarray, focal: float, size: tuple[int, int]) -> PhotoOrientation:
    """What a photo of size (h, w) tells that a homography (3, 3) rectifies to image (H, W, 3), seen (H, W) bool; focal in photo
    pixels; the principal point is the photo's centre."""
    turned, camera = camera_from_homography(homography, focal, size)
    across, _, into = turned[
        2
    ]  # the third row of a rotation into the camera's frame is the camera's axis in the plane's
    ahead = np.array([across, into]) / max(float(np.hypot(across, into)), 1e-9)
    middle = camera[0] + camera[2] * across / into if into > 0.1 else np.nan
    return PhotoOrientation(ahead, _roof(image, seen, middle, camera))


def camera_from_homography(homography: np.ndarray, focal: float, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """How the camera of a photo of size (h, w) stood before the plane that a homography (3, 3) takes the photo's pixels to.

    The rotation (3, 3) from the plane's axes (x right, y down, z into it) to the camera's, and its place (3,) in the plane's
    pixels, the third its distance."""
    height, width = size
    intrinsic = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])
    columns = np.linalg.solve(intrinsic, np.linalg.inv(homography))
    columns /= np.linalg.norm(columns[:, :2], axis=0).mean()
    if columns[2, 2] < 0:  # the plane lies before the camera
        columns = -columns
    # of three columns that are nearly a rotation's, the nearest one
    u, _, v = np.linalg.svd(np.column_stack([columns[:, 0], columns[:, 1], np.cross(columns[:, 0], columns[:, 1])]))
    rotation = u @ v
    x, y, z = -rotation.T @ columns[:, 2]
    return rotation, np.array([x, y, -z])


def _roof(image: np.ndarray, seen: np.ndarray, middle: float, camera: np.ndarray) -> float | None:
    """The height of the roof's edge over the camera by its distance, at a column of a rectified photo."""
    if not 0 <= middle < seen.shape[1]:
        return None
    half = max(2, round(COLUMNS / 2 * seen.shape[1]))
    part = np.s_[:, max(int(middle) - half, 0) : int(middle) + half]
    wall = seen[part] & ~outside_mask(image, ~seen)[part]
    top = np.argmax(wall, axis=0)
    sky = wall.any(axis=0) & (np.take_along_axis(seen[part], np.maximum(top - 3, 0)[None], 0)[0]) & (top > 3)
    if sky.mean() < SKY:
        return None
    return float((camera[1] - np.median(top[sky])) / camera[2])


def match_walls(
    scene: Scene, walls: np.ndarray, orientation: PhotoOrientation, place: np.ndarray, heading: float | None, *, seed: int
) -> WallLikelihoods:
    """How likely it is of each wall (n,), by its chart, that a photo's middle shows it.

    place (3,): where the photo says that it was taken, on the ground, metres; heading: degrees clockwise from the frame's
    north, None where it states none. seed: of the places around it that are tried."""
    charts = scene.charts
    normal, right = charts.normals()[walls], charts.axis_u[walls]
    foot = charts.points_at_shares(walls, np.array([[0.5, 1.0]]))[:, 0]
    way = orientation.ahead[0] * right - orientation.ahead[1] * normal
    way[:, 2] = 0.0
    far = np.linalg.norm((foot - place)[:, :2], axis=1) - charts.size[walls, 0] / 2
    tried = np.flatnonzero(
        (far < REACH_M)
        & (np.einsum("ij,ij->i", place - foot, normal) > -3 * PLACE_M)
        & (orientation.ahead[1] > np.cos(np.radians(GRAZING_DEG)))
    )
    around = np.random.default_rng(seed).normal(0, PLACE_M, (PLACES, 2))
    origin = np.column_stack([place[:2] + around, np.full(PLACES, place[2] + LOOK_M)])
    likely, shares = np.zeros(len(walls)), np.zeros(len(walls))
    turned, roof = np.full(len(walls), np.nan), np.full(len(walls), np.nan)
    for i in tried.tolist():
        metres, met = scene.caster.cast(origin, np.broadcast_to(way[i], origin.shape))
        hit = (met == walls[i]) & (metres < REACH_M)
        shares[i] = hit.mean()
        weight = hit.astype(float)
        if orientation.roof_slope is not None:
            before = np.where(hit, metres, 1.0) * orientation.ahead[1]
            over = charts.size[walls[i], 1] - EYE_M
            weight *= np.exp(-((np.log(max(over, 0.5) / np.maximum(orientation.roof_slope * before, 0.5)) / ROOF) ** 2) / 2)
            roof[i] = EYE_M + orientation.roof_slope * np.median(before[hit]) if hit.any() else np.nan
        likely[i] = weight.mean()
        if heading is not None:
            off = (np.degrees(np.arctan2(way[i, 0], way[i, 1])) - heading + 180) % 360 - 180
            likely[i] *= (1 - LYING) * np.exp(-((off / HEADING_DEG) ** 2) / 2) + LYING
            turned[i] = off
    return WallLikelihoods(likely / (likely.sum() + ELSEWHERE), shares, turned, roof)
