"""A trial of `benchmarks.poses`: panoramas that show the same walls, refined together.

Of the walls that two panoramas show, patches are found in each other: first the wall as a whole, within 2.6 m, then patches
of 4 m. Least squares over all turns and places: matched patches lie at one place of the wall, lines on walls are level or
upright, and each pose is drawn to the one refined alone, closely where outlines of buildings told it. Three rounds, each with
new matches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from facade_core.rectify import View, rectify_view, refine_pose, sightings
from facade_core.rectify.camera import camera_from_world, position, turned
from facade_core.rectify.wall_lines import LINE_DEG, Lines, wall_lines
from facade_core.street.scene import Scene
from facade_core.types import Pose

# Texels of a metre that walls are matched at; how far a wall and then its patches may lie off, metres; a patch's side.
DENSITY, WALL_M, AGAIN_M, PATCH_M, LOCAL_M = 10.0, 2.6, 0.8, 4.0, 0.6
# Correlations below which a wall and a patch are not found; the least share of a wall that both show; views of a wall.
WALL_FOUND, PATCH_FOUND, LEAST_SEEN, VIEWS = 0.3, 0.5, 0.25, 3
# Expected errors: east, north and up, metres, and about these axes, degrees; where outlines told the place, and where not.
TOLD, NOT_TOLD = (0.03, 0.03, 0.03, 0.05, 0.05, 0.05), (0.5, 0.5, 1.5, 0.5, 0.5, 1.0)
# Of a match, metres; the Cauchy scale of lines, degrees; so many matches of a pair count as independent.
MATCH_M, LINE_SCALE_DEG, INDEPENDENT = 0.05, 0.5, 40
ROUNDS = 3


@dataclass(frozen=True)
class Matches:
    """Of patches (k,): the chart, the two panoramas, and the camera's directions (k, 3) to it in each."""

    chart: np.ndarray
    panorama: np.ndarray  # (k, 2)
    ray: np.ndarray  # (k, 2, 3)


def refine_together(scene: Scene, images: Sequence[np.ndarray], given: Sequence[Pose]) -> list[Pose]:
    """The poses of panoramas, each refined alone first."""
    alone = [refine_pose(scene, image, pose) for image, pose in zip(images, given, strict=True)]
    start = [one.pose for one in alone]
    expected = np.array([NOT_TOLD if any("place" in why for why in one.reasons) else TOLD for one in alone])
    lines = [wall_lines(scene, image, pose) for image, pose in zip(images, start, strict=True)]
    change, poses = np.zeros((len(start), 6)), start
    for number in range(ROUNDS):
        found = _matches(scene, images, poses, AGAIN_M if number else WALL_M)
        if not len(found.chart):
            break
        change = _solved(scene, found, start, lines, expected, change)
        poses = [_changed(pose, one) for pose, one in zip(start, change, strict=True)]
    return poses


def _changed(pose: Pose, change: np.ndarray) -> Pose:
    x, y, z = position(pose) + change[:3]
    turn = Rotation.from_rotvec(np.radians(change[3:])).as_matrix()
    return replace(turned(pose, turn), x=float(x), y=float(y), z=float(z))


def _solved(
    scene: Scene,
    found: Matches,
    start: Sequence[Pose],
    lines: Sequence[Lines],
    expected: np.ndarray,
    change: np.ndarray,
) -> np.ndarray:
    charts, n = scene.charts, len(start)
    normal, origin = charts.normal()[found.chart], charts.origin[found.chart]
    axes = np.stack([charts.axis_u[found.chart], charts.axis_v[found.chart]], axis=1)
    place = np.array([position(pose) for pose in start])
    to_world = np.array([camera_from_world(pose).T for pose in start])
    pair = np.sort(found.panorama, axis=1) @ [n, 1]
    _, index, count = np.unique(pair, return_inverse=True, return_counts=True)
    weight = np.minimum(1.0, np.sqrt(INDEPENDENT / count[index.reshape(-1)])) / MATCH_M

    def lies(values: np.ndarray, side: int) -> np.ndarray:
        camera = found.panorama[:, side]
        turn = Rotation.from_rotvec(np.radians(values[:, 3:])).as_matrix()
        way = np.einsum("kij,kj->ki", (turn @ to_world)[camera], found.ray[:, side])
        at = (place + values[:, :3])[camera]
        far = np.einsum("ki,ki->k", origin - at, normal) / np.einsum("ki,ki->k", way, normal)
        return np.einsum("kai,ki->ka", axes, at + far[:, None] * way - origin)

    def residuals(flat: np.ndarray) -> np.ndarray:
        values = flat.reshape(n, 6)
        apart = (lies(values, 0) - lies(values, 1)) * weight[:, None]
        size = np.linalg.norm(apart, axis=1, keepdims=True) + 1e-9
        parts = [(apart / size * 3 * np.sqrt(np.log1p((size / 3) ** 2))).ravel(), (values / expected).ravel()]
        for own, turn in zip(lines, Rotation.from_rotvec(np.radians(values[:, 3:])).as_matrix(), strict=True):
            off = own.slopes(turn)
            robust = LINE_SCALE_DEG * np.sqrt(np.log1p((off / LINE_SCALE_DEG) ** 2)) * np.sign(off)
            parts.append(np.sqrt(own.weight) / LINE_DEG * robust)
        return np.concatenate(parts)

    return np.asarray(least_squares(residuals, change.ravel(), x_scale=0.3).x).reshape(n, 6)


def _matches(scene: Scene, images: Sequence[np.ndarray], poses: Sequence[Pose], reach: float) -> Matches:
    charts, sizes = scene.charts, [image.shape[:2] for image in images]
    chart, panorama, ray = [], [], []
    for number in np.flatnonzero(charts.size.min(axis=1) > PATCH_M).tolist():
        extent = charts.size[number]
        shape = (round(float(extent[1]) * DENSITY), round(float(extent[0]) * DENSITY))
        shown = [s.panorama for s in sightings(scene, number, poses, sizes) if s.seen >= LEAST_SEEN][:VIEWS]
        if len(shown) < 2:
            continue
        views = {p: rectify_view(scene, number, images[p], poses[p], shape) for p in shown}
        for i, one in enumerate(shown):
            for other in shown[i + 1 :]:
                for texels in _patches(views[one], views[other], reach):
                    chart.append(number)
                    panorama.append((one, other))
                    points = [charts.points(number, *(np.array([value / DENSITY]) for value in at))[0] for at in texels]
                    ways = zip(points, (poses[one], poses[other]), strict=True)
                    ray.append([camera_from_world(pose) @ (point - position(pose)) for point, pose in ways])
    return Matches(np.array(chart, int), np.array(panorama, int).reshape(-1, 2), np.array(ray).reshape(-1, 2, 3))


def _patches(one: View, other: View, reach: float) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Places (x, y), texels, in one view and in the other that show the same."""
    a, b = _slopes(one), _slopes(other)
    height, width = a.shape
    down, right = (min(round(reach * DENSITY), side // 4) for side in a.shape)
    scores = cv2.matchTemplate(a, b[down : height - down, right : width - right], cv2.TM_CCOEFF_NORMED)
    if scores.max() < WALL_FOUND:
        return []
    row, column = np.unravel_index(int(scores.argmax()), scores.shape)
    dx, dy = int(column) - right, int(row) - down
    half, local, found = round(PATCH_M * DENSITY / 2), round(LOCAL_M * DENSITY), []
    for y in range(half, height - half + 1, half):
        for x in range(half, width - half + 1, half):
            patch = b[y - half : y + half, x - half : x + half]
            top, left = y + dy - half - local, x + dx - half - local
            within = a[max(top, 0) : top + 2 * (half + local), max(left, 0) : left + 2 * (half + local)]
            if within.shape != (2 * (half + local),) * 2 or patch.std() < 2 or (patch > 0).mean() < 0.8:
                continue
            fits = cv2.matchTemplate(within, patch, cv2.TM_CCOEFF_NORMED)
            r, c = np.unravel_index(int(fits.argmax()), fits.shape)
            if fits[r, c] >= PATCH_FOUND and 0 < r < 2 * local and 0 < c < 2 * local:
                fine_x, fine_y = _peak(fits[r, c - 1 : c + 2]), _peak(fits[r - 1 : r + 2, c])
                found.append(((x + dx + c - local + fine_x, y + dy + r - local + fine_y), (float(x), float(y))))
    return found


def _peak(three: np.ndarray) -> float:
    """Where the parabola through three values has its peak, from the middle one."""
    low, middle, high = (float(value) for value in three)
    bend = low - 2 * middle + high
    return 0.5 * (low - high) / bend if bend < -1e-9 else 0.0


def _slopes(view: View) -> np.ndarray:
    """How steep a view's grey is, (h, w) float32, 0 near what is not seen: exposures differ, edges less."""
    grey = cv2.GaussianBlur(cv2.cvtColor(view.rgb, cv2.COLOR_RGB2GRAY).astype(np.float32), (0, 0), 1.0)
    seen = cv2.erode(view.seen.astype(np.uint8), np.ones((5, 5), np.uint8), borderValue=0)
    return np.hypot(cv2.Sobel(grey, cv2.CV_32F, 1, 0), cv2.Sobel(grey, cv2.CV_32F, 0, 1)) * (seen > 0)
