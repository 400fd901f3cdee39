"""One exposure for the panoramas of a block: factors per camera and colour, by what neighbours show of the same ground."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from facade_core.core.types import Pose
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.raycast import MISS
from facade_core.geometry.scene import Scene
from facade_core.imagery.poses.panorama_camera import in_view, position, shares

# Side of the squares of the world grid whose colours are compared, metres: more than a pose is off.
SQUARE_M = 2.0
# From so near to so far from a camera its ground is sampled, metres.
NEAR_M, FAR_M = 4.0, 14.0
# Rays that look for the ground: around, and from so many degrees below the horizon to so many.
AROUND, STEPS, STEEP_DEG, FLAT_DEG = 240, 32, 40.0, 8.0
# Samples that make a square's colour; squares that make a pair's ratio; colours that tell of exposure.
LEAST_SAMPLES, LEAST_SHARED, EXPOSED = 3, 6, (8, 247)
# Factors beyond these say that two pictures do not show the same thing.
MOST = 2.0
# How strongly each camera is held to no factor at all, beside a pair's weight of the root of its squares: what many share is
# their difference, and not that all are too dark.
HELD = 0.3
# Factors are whole numbers of these: what hardly changes makes nobody due again.
STEP = 1 / 64


class GroundSamples(NamedTuple):
    """What one camera shows of the ground.

    height: the camera's over it, metres; None where there is no ground below.
    squares (n, 5): east and north of the square in SQUARE_M, and its red, green and blue; whole numbers.
    """

    height: float | None
    squares: list[list[int]]


def sample_ground(scene: Scene, image: np.ndarray, pose: Pose) -> GroundSamples:
    """The ground around a panorama by squares of the world grid, each the median of what is in sight of it.

    image (H, W, 3) uint8 is the part pose.view of the full panorama. Raises GeometryError for a pose without height.
    """
    import cv2

    place = position(pose)
    below, chart = scene.caster.cast(place, np.array([[0.0, 0.0, -1.0]]))
    if chart[0] == MISS or scene.charts.kind[chart[0]] != ChartKind.GROUND:
        return GroundSamples(None, [])
    latitude = np.radians(-np.linspace(FLAT_DEG, STEEP_DEG, STEPS))[:, None]
    longitude = (np.arange(AROUND) + 0.5)[None] / AROUND * 2 * np.pi
    rays = np.stack(
        [
            np.sin(longitude) * np.cos(latitude),
            np.cos(longitude) * np.cos(latitude),
            np.broadcast_to(np.sin(latitude), (STEPS, AROUND)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    depth, hit = scene.caster.cast(place, rays)
    away = depth * np.hypot(rays[:, 0], rays[:, 1])
    share = shares(rays, pose)
    usable = (hit != MISS) & (away >= NEAR_M) & (away <= FAR_M) & in_view(share, pose)
    usable[usable] = scene.charts.kind[hit[usable]] == ChartKind.GROUND
    if not usable.any():
        return GroundSamples(round(float(below[0]), 3), [])
    left, top, wide, high = pose.view
    columns = max(1, round(2 * AROUND * wide))
    small = cv2.resize(image, (columns, max(1, round(AROUND * high))), interpolation=cv2.INTER_AREA)
    column = ((share[usable, 0] - left) % 1.0 / wide * columns).astype(np.intp).clip(max=columns - 1)
    row = ((share[usable, 1] - top) / high * len(small)).astype(np.intp).clip(0, len(small) - 1)
    colour = small[row, column]
    points = place[:2] + (depth[usable, None] * rays[usable])[:, :2]
    square, of = np.unique(np.floor(points / SQUARE_M).astype(np.int64), axis=0, return_inverse=True)
    of = of.reshape(-1)
    squares = []
    for index, (east, north) in enumerate(square.tolist()):
        own = colour[of == index]
        if len(own) >= LEAST_SAMPLES:
            squares.append([east, north, *np.round(np.median(own, axis=0)).astype(int).tolist()])
    return GroundSamples(round(float(below[0]), 3), squares)


def exposure_factors(squares_by_camera: Sequence[Sequence[Sequence[int]]]) -> np.ndarray:
    """Factors (n, 3) that bring the pictures of n cameras to one exposure and white balance, by their squares as of `Ground`.

    Least squares over the pairs that share squares, each pair's ratio a median; the factors' mean is one. A camera that shares
    nothing keeps its colours.
    """
    n = len(squares_by_camera)
    known = [{(one[0], one[1]): one[2:] for one in squares if _exposed(one[2:])} for squares in squares_by_camera]
    at: dict[tuple[int, int], list[int]] = {}
    for camera, squares in enumerate(known):
        for square in squares:
            at.setdefault(square, []).append(camera)
    pairs = sorted({(i, j) for cameras in at.values() for i in cameras for j in cameras if i < j})
    equations, ratios = [], []
    for i, j in pairs:
        shared = sorted(known[i].keys() & known[j].keys())
        if len(shared) >= LEAST_SHARED:
            both = np.array([[known[one][square] for square in shared] for one in (i, j)], np.float64)
            weight = np.sqrt(len(shared))
            equations.append((i, j, weight))
            ratios.append(weight * np.median(np.log(both[1] / both[0]), axis=0))
    if not equations:
        return np.ones((n, 3))
    from scipy.sparse import coo_array, vstack
    from scipy.sparse.linalg import spsolve

    first, second, weight = (np.array(column) for column in zip(*equations, strict=True))
    row = np.arange(len(equations))
    matrix = coo_array(
        (np.concatenate([weight, -weight]), (np.tile(row, 2), np.concatenate([first, second]))), (len(row), n)
    )
    held = coo_array((np.full(n, HELD), (np.arange(n), np.arange(n))), (n, n))
    whole = vstack([matrix, held]).tocsc()
    right = np.vstack([*ratios, np.zeros((n, 3))])
    solution = np.column_stack([spsolve((whole.T @ whole).tocsc(), whole.T @ right[:, band]) for band in range(3)])
    return np.round(np.exp(np.clip(solution, -np.log(MOST), np.log(MOST))) / STEP) * STEP


def typical_ground_colour(squares: Sequence[Sequence[int]]) -> tuple[np.ndarray, np.ndarray] | None:
    """What the ground around a camera mostly looks like: logarithm of its colour (3,) and how far half of it is off that (3,);
    None where too little of it is known."""
    colours = np.array([one[2:] for one in squares if _exposed(one[2:])], np.float64)
    if len(colours) < LEAST_SHARED:
        return None
    logs = np.log(colours)
    middle = np.median(logs, axis=0)
    return middle, np.median(np.abs(logs - middle), axis=0)


def _exposed(colour: Sequence[int]) -> bool:
    return min(colour) >= EXPOSED[0] and max(colour) <= EXPOSED[1]
