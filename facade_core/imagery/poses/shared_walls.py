"""Where panoramas show the same of a wall, or of a piece of ground: all of it, then patches, by how steep their greys are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np

from facade_core.core.types import Pose
from facade_core.geometry.scene import Scene
from facade_core.imagery.poses.bundles import MIN_WALL_SHARE
from facade_core.imagery.poses.panorama_camera import camera_from_world, camera_position
from facade_core.imagery.rectify.fusion import ChartView
from facade_core.imagery.rectify.panorama import find_sightings, rectify_view

# Texels of a metre that walls are compared at; a patch's side, and how far it may lie off the wall it is on, metres.
DENSITY, PATCH_M, LOCAL_M = 10.0, 4.0, 0.6
# Correlations below which a wall and a patch are not found.
WALL_FOUND, PATCH_FOUND = 0.3, 0.5
# A wall that fits nearly as well so far off where it fits best, metres, does not tell where it is: its windows repeat.
APART_M, NEARLY = 1.0, 0.9
# Views of a wall that are compared with each other, the best.
VIEWS = 3
# How steep the grey of a patch must vary, and the share of it that must be seen, and of a wall by both, to be looked for.
LEAST_STEEP, LEAST_SHOWN, LEAST_BOTH = 2.0, 0.8, 0.05
# Texels by which two pictures of a wall may be shifted and lie at one place.
HERE = 1


@dataclass(frozen=True, slots=True)
class PatchMatches:
    """Patches (k,) that two panoramas show: chart (k,); panorama (k, 2); ray (k, 2, 3), directions to the patch in the axes of
    each camera."""

    chart: np.ndarray
    panorama: np.ndarray
    ray: np.ndarray

    def __len__(self) -> int:
        return len(self.chart)

    def select(self, rows: np.ndarray) -> PatchMatches:
        """Some of them, by index or bool."""
        return PatchMatches(self.chart[rows], self.panorama[rows], self.ray[rows])


class GradientImage(NamedTuple):
    """How steep the grey of a surface is as a panorama shows it, slope (h, w) float32, 0 near what is not seen (h, w) bool."""

    slope: np.ndarray
    seen: np.ndarray


class WallAgreement(NamedTuple):
    """Two panoramas and a surface, and how well what they show there agrees as it lies, -1 to 1."""

    panorama: tuple[int, int]
    chart: int
    score: float


def match_shared_walls(
    scene: Scene,
    surfaces: Sequence[int],
    images: Sequence[np.ndarray],
    poses: Sequence[Pose],
    max_offset: float,
    *,
    poses_agree: bool = False,
) -> tuple[PatchMatches, list[WallAgreement]]:
    """What panoramas show of the same surfaces, within `reach` metres of where their poses have it.

    surfaces: charts of walls and ground; images (H, W, 3) uint8 as of `rectify_view`. Normalised correlation of gradient
    magnitudes: exposures differ, edges less. A patch lies where a parabola through three correlations has its peak. agreed:
    whether poses agree already: of a surface that is not found as a whole patches are looked for where poses have it.
    """
    charts, placement, sizes = scene.charts, scene.placement, [image.shape[:2] for image in images]
    chart, panorama, ray, alike = [], [], [], []
    for number in surfaces:
        extent = charts.size[number]
        if extent.min() <= PATCH_M:
            continue
        shape = (round(float(extent[1]) * DENSITY), round(float(extent[0]) * DENSITY))
        shown = [s.panorama for s in find_sightings(scene, number, poses, sizes) if s.seen >= MIN_WALL_SHARE][:VIEWS]
        if len(shown) < 2:
            continue
        side = np.array([placement.width[number], placement.height[number]]) / placement.texels_per_metre[number]
        step = side / shape[::-1]
        steep = {p: _steep(rectify_view(scene, number, images[p], poses[p], shape)) for p in shown}
        for pair in combinations(sorted(shown), 2):
            one, other = (steep[p] for p in pair)
            alike.append(WallAgreement(pair, number, _gradient_correlation(one, other)))
            shift = _find_shift(one, other, max_offset)
            if shift is None and not poses_agree:
                continue
            for texels in _match_patches(one, other, shift or (0, 0)):
                points = [charts.points(number, *(step * at)[:, None])[0] for at in texels]
                ways = zip(points, (poses[p] for p in pair), strict=True)
                chart.append(number)
                panorama.append(pair)
                ray.append([camera_from_world(pose) @ (point - camera_position(pose)) for point, pose in ways])
    found = PatchMatches(np.array(chart, int), np.array(panorama, int).reshape(-1, 2), np.array(ray).reshape(-1, 2, 3))
    return found, alike


def _gradient_correlation(one: GradientImage, other: GradientImage) -> float:
    """How well two pictures of a surface agree as they lie, but for HERE: correlation over what both show, -1 to 1."""
    best, inner = -1.0, slice(HERE, -HERE)
    a, seen = one.slope[inner, inner], one.seen[inner, inner]
    rows, columns = a.shape
    for down in range(2 * HERE + 1):
        for right in range(2 * HERE + 1):
            part = slice(down, down + rows), slice(right, right + columns)
            both = seen & other.seen[part]
            x, y = a[both], other.slope[part][both]
            if both.mean() >= LEAST_BOTH and x.std() > 0 and y.std() > 0:
                best = max(best, float(np.corrcoef(x, y)[0, 1]))
    return best


def _find_shift(one: GradientImage, other: GradientImage, reach: float) -> tuple[int, int] | None:
    """By how many texels (x, y) a surface lies off in the other picture of it; None where it is not found, or might be
    elsewhere."""
    import cv2

    height, width = one.slope.shape
    down, right = (min(round(reach * DENSITY), side // 4) for side in (height, width))
    around = np.ones((2 * down + 1, 2 * right + 1), np.uint8)
    both = cv2.erode(one.seen.astype(np.uint8), around) & other.seen  # wherever it is shifted to
    inner = slice(down, height - down), slice(right, width - right)
    if both[inner].mean() < LEAST_BOTH or other.slope[inner][both[inner] > 0].std() == 0:
        return None
    scores = cv2.matchTemplate(one.slope, other.slope[inner], cv2.TM_CCOEFF_NORMED, mask=both[inner].astype(np.float32))
    scores[~np.isfinite(scores)] = -1.0
    row, column = (int(at) for at in np.unravel_index(int(scores.argmax()), scores.shape))
    rows, columns = np.indices(scores.shape)
    elsewhere = float(scores[np.hypot(rows - row, columns - column) > APART_M * DENSITY].max(initial=-1.0))
    if scores[row, column] < WALL_FOUND or elsewhere > NEARLY * scores[row, column]:
        return None
    return column - right, row - down


def _match_patches(one: GradientImage, other: GradientImage, shift: tuple[int, int]) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Places (x, y), texels, in one picture and in the other that show the same."""
    import cv2

    height, width = one.slope.shape
    half, local, found = round(PATCH_M * DENSITY / 2), round(LOCAL_M * DENSITY), []
    for y in range(half, height - half + 1, half):
        for x in range(half, width - half + 1, half):
            at = slice(y - half, y + half), slice(x - half, x + half)
            patch = other.slope[at]
            left, top = (max(0, to + by - half - local) for to, by in zip((x, y), shift, strict=True))
            around = slice(top, y + shift[1] + half + local), slice(left, x + shift[0] + half + local)
            within = one.slope[around]
            if min(within.shape) < 2 * half + 3 or patch.std() < LEAST_STEEP:
                continue
            if min(other.seen[at].mean(), one.seen[around].mean()) < LEAST_SHOWN:
                continue
            fits = cv2.matchTemplate(within, patch, cv2.TM_CCOEFF_NORMED)
            row, column = (int(at) for at in np.unravel_index(int(fits.argmax()), fits.shape))
            last = fits.shape[0] - 1, fits.shape[1] - 1
            if fits[row, column] < PATCH_FOUND or not (0 < row < last[0] and 0 < column < last[1]):
                continue
            fine_x, fine_y = _peak(fits[row, column - 1 : column + 2]), _peak(fits[row - 1 : row + 2, column])
            found.append(((left + half + column + fine_x, top + half + row + fine_y), (float(x), float(y))))
    return found


def _peak(three: np.ndarray) -> float:
    """Where the parabola through three values has its peak, from the middle one."""
    low, middle, high = (float(value) for value in three)
    bend = low - 2 * middle + high
    return 0.5 * (low - high) / bend if bend < -1e-9 else 0.0


def _steep(view: ChartView) -> GradientImage:
    import cv2

    grey = cv2.GaussianBlur(cv2.cvtColor(view.rgb, cv2.COLOR_RGB2GRAY).astype(np.float32), (0, 0), 1.0)
    seen = cv2.erode(view.seen.astype(np.uint8), np.ones((5, 5), np.uint8), borderValue=0) > 0
    return GradientImage(np.hypot(cv2.Sobel(grey, cv2.CV_32F, 1, 0), cv2.Sobel(grey, cv2.CV_32F, 0, 1)) * seen, seen)
