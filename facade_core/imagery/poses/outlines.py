"""The place of a posed panorama from outlines: corners, eaves and silhouettes of the mesh on the picture's own edges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from facade_core.core.numba_cache import njit
from facade_core.core.types import Pose
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.scene import Scene
from facade_core.imagery.poses.panorama_camera import camera_from_world, camera_position

# Edges farther away say nothing of a place; metres between samples, and how many are judged together.
MAX_OUTLINE_DISTANCE_M, SPACING_M, GROUP = 60.0, 0.25, 10
# A sample is seen where nothing stands this far before it; what lies to its sides is looked up this far off it.
SKIN_M, BESIDE_DEG = 0.15, 0.7
# Surfaces that differ less than this in direction or in depth are one.
SAME_COS, SAME_M = np.cos(np.radians(10.0)), 0.25
# Panoramas that are searched, to find the place and to fix it: their widest full turn and its blur, in pixels.
COARSE, FINE = (2048, 3.0), (4096, 2.0)
# Grey levels of a step that counts in full: the sky behind an eaves, more than a moulding below it.
FULL_STEP = 80.0
# What stands against the sky is seen; a corner between two walls of one brick, or of an embrasure, often is not, and counts so
# much of it.
INNER = 0.15
# The search: metres to either side on the level and in height, steps.
LEVEL_M, STEP_M, HEIGHT_M, UP_STEP_M = 1.0, 0.25, 1.0, 0.5
# Cost of an offset of one metre, squared with it: on the level; in height where that is stated, and where it is `height_is_assumed`.
LEVEL_PULL, STATED_PULL, CARRIED_PULL = 0.08, 0.02, 0.25
# Cost of a turn by the expected error of the heading, squared with it.
TURN_PULL = 0.02
# Cost of a pose that is one standard error off; errors east, north and up, metres, and of the heading, degrees, at most.
COST, EXPECTED, CARRIED_UP = 0.01, np.array([0.25, 0.25, 1.0, 0.5]), 0.3


@dataclass(frozen=True, slots=True, eq=False)
class OutlineSamples:
    """Samples of mesh edges in sight, in groups of neighbours on one edge: point, along (k, 3) world place and direction; group
    (k,) int64, ascending from 0; weight (groups,), angular length in radians, INNER of it where it is not against the sky."""

    point: np.ndarray
    along: np.ndarray
    group: np.ndarray
    weight: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Gradients:
    """Colour gradients of a panorama: slope (h, w, 6) int16, three channels across, then three down, in eighths of grey levels
    per pixel; turn, the pixels of a full turn; left, top: the picture's first pixel in the full panorama; blur in pixels."""

    slope: np.ndarray
    turn: float
    left: float
    top: float
    blur: float


@dataclass(frozen=True, slots=True, eq=False)
class PlaceEstimate:
    """offset (3,) metres from a pose; turn_deg, clockwise from above, of its heading; the fit there; spread (4, 4),
    the covariance of offset and turn_deg."""

    offset: np.ndarray
    turn_deg: float
    outline_fit: float
    covariance: np.ndarray


def sample_outline(scene: Scene, pose: Pose) -> OutlineSamples:
    """The edges of walls and roofs that a camera sees against other surfaces or the sky."""
    place = camera_position(pose)
    ends = _edges(scene, place)
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    count = np.maximum(1, (length / SPACING_M).astype(int))
    edge = np.repeat(np.arange(len(ends)), count)
    number = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    along = (ends[:, 1] - ends[:, 0]) / np.maximum(length, 1e-9)[:, None]
    point = ends[edge, 0] + ((number + 0.5) / count[edge] * length[edge])[:, None] * along[edge]
    along = along[edge]
    kept, sky = _stands_out(scene, place, point, along)
    point, along, edge, number, sky = point[kept], along[kept], edge[kept], number[kept], sky[kept]
    key, group = np.unique(np.column_stack([edge, number // GROUP]), axis=0, return_inverse=True)
    group = group.reshape(-1)
    rays = point - place
    distance = np.linalg.norm(rays, axis=1)
    sine = np.linalg.norm(np.cross(along, rays), axis=1) / distance
    weight = np.bincount(group, SPACING_M * sine / distance * np.where(sky, 1.0, INNER), minlength=len(key))
    weight[np.bincount(group, minlength=len(key)) < 3] = 0
    return OutlineSamples(point, along, group.astype(np.int64), weight)


def _edges(scene: Scene, place: np.ndarray) -> np.ndarray:
    """Ends (k, 2, 3) of the outlines of surfaces other than the ground near a place."""
    mesh, charts = scene.mesh, scene.charts
    corners = mesh.vertices[mesh.triangles]
    near = (np.linalg.norm(corners - place, axis=2).min(axis=1) < MAX_OUTLINE_DISTANCE_M) & (
        charts.kind[mesh.chart] != ChartKind.GROUND
    )
    triangles, surface = corners[near], charts.surface[mesh.chart[near]]
    sides = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2, 3)
    _, index = np.unique(np.round(sides.reshape(-1, 3) * 100).astype(np.int64), axis=0, return_inverse=True)
    pair = np.sort(index.reshape(-1, 2), axis=1)
    key = np.column_stack([np.repeat(surface, 3), pair])
    _, first, count = np.unique(key, axis=0, return_index=True, return_counts=True)
    own = np.sort(first[count == 1])
    _, once = np.unique(pair[own], axis=0, return_index=True)  # an edge that two surfaces share counts once
    return sides[own[np.sort(once)]]


def _stands_out(scene: Scene, place: np.ndarray, point: np.ndarray, along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether samples (k, 3) are in sight with different things to their sides, the ground aside, and whether one of these is
    the sky: (k,) bool each."""
    charts = scene.charts
    rays = point - place
    distance = np.linalg.norm(rays, axis=1)
    across = np.cross(along, rays)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    normal, plane = charts.normals(), np.einsum("ij,ij->i", charts.normals(), charts.origin)
    depths, hits = [], []
    for side in (1, -1):
        tilted = rays + side * np.tan(np.radians(BESIDE_DEG)) * distance[:, None] * across
        depth, hit = scene.caster.cast(place, tilted)
        depths.append(depth)
        hits.append(hit)
    one, other = hits
    nearest = np.minimum(*depths)
    seen = (nearest * distance > distance - SKIN_M - 0.15 * distance) & (nearest < 1.5)
    level, _ = scene.caster.cast(place, rays * (1 - SKIN_M / np.maximum(distance, 2 * SKIN_M))[:, None])
    seen &= level >= 1.0
    alike = (np.einsum("ij,ij->i", normal[one], normal[other]) > SAME_COS) & (
        np.abs(plane[one] - plane[other]) < SAME_M
    )
    same = (one >= 0) & (other >= 0) & alike & (charts.building[one] == charts.building[other])
    ground = ((one >= 0) & (charts.kind[one] == ChartKind.GROUND)) | (
        (other >= 0) & (charts.kind[other] == ChartKind.GROUND)
    )
    return seen & ~same & ~ground & (distance < MAX_OUTLINE_DISTANCE_M) & (distance > 1.0), (one < 0) | (other < 0)


def image_gradients(image: np.ndarray, pose: Pose, turn_pixels: int, blur: float) -> Gradients:
    """The gradients of a panorama (H, W, 3) uint8, the part pose.view of the full one, shrunk to `widest` pixels a turn."""
    import cv2

    left, top, width, _ = pose.view
    shrink = min(1.0, turn_pixels * width / image.shape[1])
    size = (round(image.shape[1] * shrink), round(image.shape[0] * shrink))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA) if shrink < 1 else image
    rim = int(4 * blur)
    wrapped = cv2.copyMakeBorder(small, 0, 0, rim, rim, cv2.BORDER_WRAP if width == 1 else cv2.BORDER_REPLICATE)
    soft = cv2.GaussianBlur(wrapped, (0, 0), blur)
    slope = [cv2.Sobel(soft, cv2.CV_16S, *order, ksize=3)[:, rim:-rim] for order in ((1, 0), (0, 1))]
    turn = size[0] / width
    return Gradients(np.concatenate(slope, axis=2), turn, left * turn, top * turn / 2, blur)


def outline_fit(outline: OutlineSamples, picture: Gradients, pose: Pose, offset: np.ndarray, turn_deg: float = 0.0) -> float:
    """How well the outline lies on edges of the picture from pose + offset (3,), turned about the vertical: 0 to 1."""
    if len(outline.group) == 0 or outline.weight.sum() == 0:
        return 0.0
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    camera = camera_from_world(pose) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    place = camera_position(pose) + offset
    geometry = (picture.turn, picture.left, picture.top)
    response = _respond(
        outline.point, outline.along, outline.group, place, camera, geometry, picture.slope, len(outline.weight)
    )
    step = response / 8 * picture.blur * np.sqrt(2 * np.pi)
    return float((outline.weight * np.minimum(step / FULL_STEP, 1)).sum() / outline.weight.sum())


def search_gradients(image: np.ndarray, pose: Pose) -> tuple[Gradients, Gradients]:
    """The gradients of a panorama to find its place on, and to fix it on."""
    return image_gradients(image, pose, *COARSE), image_gradients(image, pose, *FINE)


def find_place(
    outline: OutlineSamples,
    pictures: tuple[Gradients, Gradients],
    pose: Pose,
    *,
    heading_deg: float,
    height_is_assumed: bool = False,
) -> PlaceEstimate:
    """Where the outline fits best near a pose: a grid on blurred gradients, then simplexes, at last on sharp ones.

    pictures: as of `search_gradients`. heading_deg is the expected error of the pose's heading. carried: whether the pose's height is
    that at which cameras are carried over the ground, or the roofs around are as high as was guessed: neither is to be mended
    by the other's error. What lies farther from the pose must fit better.
    """
    from scipy.optimize import minimize

    pulls = np.array([LEVEL_PULL, LEVEL_PULL, CARRIED_PULL if height_is_assumed else STATED_PULL])

    def cost(picture: Gradients, v: np.ndarray) -> float:
        pull = float(pulls @ v[:3] ** 2) + TURN_PULL * float(v[3] / heading_deg) ** 2
        return pull - outline_fit(outline, picture, pose, v[:3], float(v[3]))

    coarse, fine = pictures
    level = np.arange(-LEVEL_M, LEVEL_M + 1e-9, STEP_M)
    height = np.arange(-HEIGHT_M, HEIGHT_M + 1e-9, UP_STEP_M)
    turns = np.arange(-2, 3) * heading_deg / 2 if heading_deg > 0.2 else np.zeros(1)
    grid = np.stack(np.meshgrid(level, level, height, turns, indexing="ij"), axis=-1).reshape(-1, 4)
    best = grid[int(np.argmin([cost(coarse, v) for v in grid]))]
    for picture, size in ((coarse, STEP_M / 2), (fine, STEP_M / 4)):
        corners = best + np.vstack([np.zeros(4), np.diag([size, size, size * UP_STEP_M / STEP_M, heading_deg / 2])])
        options = {"initial_simplex": corners, "xatol": 1e-3, "fatol": 1e-5, "maxiter": 200}
        best = minimize(lambda v, p=picture: cost(p, v), best, method="Nelder-Mead", options=options).x
    turn_deg = float(best[3])
    return PlaceEstimate(
        best[:3],
        turn_deg,
        outline_fit(outline, fine, pose, best[:3], turn_deg),
        _spread(
            lambda v: -outline_fit(outline, coarse, pose, v[:3], float(v[3])),
            best,
            np.array([STEP_M, STEP_M, STEP_M, heading_deg]),
            np.where([False, False, height_is_assumed, False], CARRIED_UP, EXPECTED),
        ),
    )


def _spread(
    cost: Callable[[np.ndarray], float], best: np.ndarray, steps: np.ndarray, expected: np.ndarray
) -> np.ndarray:
    """The covariance (4, 4) of what costs least: the inverse of how the cost bends between steps (4,), times COST; errors of
    `expected` (4,) at most, as of a pose that nothing told.

    Along an edge the outline fits as well as before, and across a far one nearly: height and distance stand for each other.
    """
    off = np.diag(steps)
    bend = np.empty((4, 4))
    for i in range(4):
        for j in range(i, 4):
            at = [cost(best + a * off[i] + b * off[j]) for a, b in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
            bend[i, j] = bend[j, i] = (at[0] - at[1] - at[2] + at[3]) / (4 * steps[i] * steps[j])
    values, axes = np.linalg.eigh(bend * np.outer(expected, expected))  # in units in which all are alike
    scaled = axes / np.maximum(values, COST) @ axes.T
    return np.asarray(COST * scaled * np.outer(expected, expected))


@njit(cache=True, nogil=True)
def _respond(
    point: np.ndarray,
    along: np.ndarray,
    group: np.ndarray,
    place: np.ndarray,
    camera: np.ndarray,
    geometry: tuple[float, float, float],
    slope: np.ndarray,
    groups: int,
) -> np.ndarray:
    """Mean over each group's samples of the gradient across the edge, its channels' absolute values averaged: (groups,)."""
    rows, columns = slope.shape[:2]
    turn, left, top = geometry
    total = np.zeros((groups, 3))
    count = np.zeros(groups)
    at = np.empty((2, 2))
    c = np.empty(3)
    for k in range(len(point)):
        for end in range(2):
            for i in range(3):
                c[i] = 0.0
                for j in range(3):
                    c[i] += camera[i, j] * (point[k, j] + 0.02 * end * along[k, j] - place[j])
            at[end, 0] = (np.arctan2(c[0], c[2]) / (2 * np.pi) + 0.5) * turn - left
            at[end, 1] = (0.5 + np.arctan2(c[1], np.hypot(c[0], c[2])) / np.pi) * turn / 2 - top
        du, dv = at[1, 0] - at[0, 0], at[1, 1] - at[0, 1]
        du -= turn * np.round(du / turn)
        norm = np.hypot(du, dv) + 1e-12
        x, y = at[0, 0] % turn - 0.5, at[0, 1] - 0.5
        x0, y0 = int(np.floor(x)), int(np.floor(y))
        count[group[k]] += 1
        if y0 < 0 or y0 + 1 >= rows or x0 >= columns:
            continue
        fx, fy = x - x0, y - y0
        for dy in range(2):
            for dx in range(2):
                w = (fx if dx else 1 - fx) * (fy if dy else 1 - fy)
                column = (x0 + dx) % int(turn)
                if column >= columns:
                    continue
                for channel in range(3):
                    across = slope[y0 + dy, column, channel] * (-dv) + slope[y0 + dy, column, channel + 3] * du
                    total[group[k], channel] += w * across / norm
    response = np.zeros(groups)
    for g in range(groups):
        for channel in range(3):
            response[g] += abs(total[g, channel]) / max(count[g], 1) / 3
    return response
