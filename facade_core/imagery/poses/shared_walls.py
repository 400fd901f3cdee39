"""Common patches of walls and ground in panoramas.

Gradient magnitudes are correlated, of whole surfaces first, then of patches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import (
    BoolArray,
    Float32Array,
    Float64Array,
    Int64Array,
    IntArray,
    NumericArray,
    UInt8Array,
)
from facade_core.core.types import Pose
from facade_core.geometry.scene import Scene
from facade_core.imagery.panorama_camera import camera_from_world, camera_position
from facade_core.imagery.poses.settings import PANORAMA_BUNDLES, SHARED_WALLS
from facade_core.imagery.rectify.fusion import ChartView
from facade_core.imagery.rectify.panorama import find_sightings, rectify_chart_from_panorama


@dataclass(frozen=True, slots=True)
class PatchMatches:
    """Patches (k,) that two panoramas show.

    Attributes
    ----------
    chart : (k,) chart of each patch.
    panorama : (k, 2) both panoramas.
    ray : (k, 2, 3) directions to the patch in each camera's axes.
    """

    chart: Int64Array
    panorama: Int64Array
    ray: Float64Array

    def __len__(self) -> int:
        return len(self.chart)

    def select(self, rows: IntArray | BoolArray) -> PatchMatches:
        """Select matches by index or mask."""
        return PatchMatches(self.chart[rows], self.panorama[rows], self.ray[rows])


class GradientImage(NamedTuple):
    """Gradient magnitude of a rectified surface.

    Attributes
    ----------
    slope : (h, w) float32, 0 near unseen pixels.
    seen : (h, w) bool.
    """

    slope: Float32Array
    seen: BoolArray


class SurfaceCorrelation(NamedTuple):
    """Correlation, -1 to 1, of one wall or ground surface between two panoramas."""

    panorama: tuple[int, int]
    chart: int
    score: float


def match_patches_between_panoramas(
    scene: Scene,
    surfaces: Sequence[int],
    images: Sequence[UInt8Array],
    poses: Sequence[Pose],
    max_offset: float,
    *,
    poses_agree: bool = False,
) -> tuple[PatchMatches, list[SurfaceCorrelation]]:
    """Match patches of shared walls and ground between panoramas, by gradient correlation.

    Uses normalised correlation of gradient magnitudes, which depend less on the exposure than colours. A parabola
    through three correlations gives the subpixel position.

    Parameters
    ----------
    scene : scene that contains the surfaces.
    surfaces : charts of walls and ground.
    images : (H, W, 3) uint8 as in `rectify_chart_from_panorama`.
    poses : pose of each image.
    max_offset : largest offset of a surface from its position by the poses, in metres.
    poses_agree : poses agree already; patches of a surface that is not found as a whole are searched at its position.

    Returns
    -------
    The matches, and the agreement of each pair on each surface.
    """
    charts, placement, sizes = scene.charts, scene.placement, [image.shape[:2] for image in images]
    chart, panorama, ray, agreements = [], [], [], []
    for number in surfaces:
        extent = charts.size[number]
        if extent.min() <= SHARED_WALLS.patch_side_m:
            continue
        shape = (
            round(float(extent[1]) * SHARED_WALLS.texels_per_metre),
            round(float(extent[0]) * SHARED_WALLS.texels_per_metre),
        )
        sightings = [
            s.panorama
            for s in find_sightings(scene, number, poses, sizes)
            if s.seen_share >= PANORAMA_BUNDLES.min_wall_share
        ][: SHARED_WALLS.max_views]
        if len(sightings) < 2:
            continue
        side = np.array([placement.width[number], placement.height[number]]) / placement.texels_per_metre[number]
        step = side / shape[::-1]
        gradients = {
            p: _gradient_image(rectify_chart_from_panorama(scene, number, images[p], poses[p], shape))
            for p in sightings
        }
        for pair in combinations(sorted(sightings), 2):
            one, other = (gradients[p] for p in pair)
            agreements.append(SurfaceCorrelation(pair, number, _gradient_correlation(one, other)))
            shift = _find_shift(one, other, max_offset)
            if shift is None and not poses_agree:
                continue
            for texels in _match_patches(one, other, shift or (0, 0)):
                points = [charts.points(number, *(step * place)[:, None])[0] for place in texels]
                rays_from = zip(points, (poses[p] for p in pair), strict=True)
                chart.append(number)
                panorama.append(pair)
                ray.append([camera_from_world(pose) @ (point - camera_position(pose)) for point, pose in rays_from])
    matches = PatchMatches(
        np.array(chart, int), np.array(panorama, int).reshape(-1, 2), np.array(ray).reshape(-1, 2, 3)
    )
    return matches, agreements


def _gradient_correlation(one: GradientImage, other: GradientImage) -> float:
    """Correlation, -1 to 1, of two aligned pictures over common pixels, the best within aligned_texels."""
    best, inner = -1.0, slice(SHARED_WALLS.aligned_texels, -SHARED_WALLS.aligned_texels)
    a, seen = one.slope[inner, inner], one.seen[inner, inner]
    rows, columns = a.shape
    for down in range(2 * SHARED_WALLS.aligned_texels + 1):
        for right in range(2 * SHARED_WALLS.aligned_texels + 1):
            part = slice(down, down + rows), slice(right, right + columns)
            both = seen & other.seen[part]
            x, y = a[both], other.slope[part][both]
            if both.mean() >= SHARED_WALLS.min_common_share and x.std() > 0 and y.std() > 0:
                best = max(best, float(np.corrcoef(x, y)[0, 1]))
    return best


def _find_shift(one: GradientImage, other: GradientImage, reach: float) -> tuple[int, int] | None:
    """Shift (x, y) in texels of the surface in the other picture; None if not found or ambiguous."""
    import cv2

    height, width = one.slope.shape
    down, right = (min(round(reach * SHARED_WALLS.texels_per_metre), side // 4) for side in (height, width))
    around = np.ones((2 * down + 1, 2 * right + 1), np.uint8)
    both = np.asarray(cv2.erode(one.seen.astype(np.uint8), around), np.uint8) & other.seen  # seen under every shift
    inner = slice(down, height - down), slice(right, width - right)
    if both[inner].mean() < SHARED_WALLS.min_common_share or other.slope[inner][both[inner] > 0].std() == 0:
        return None
    scores = cv2.matchTemplate(one.slope, other.slope[inner], cv2.TM_CCOEFF_NORMED, mask=both[inner].astype(np.float32))
    scores[~np.isfinite(scores)] = -1.0
    row, column = (int(index) for index in np.unravel_index(int(scores.argmax()), scores.shape))
    rows, columns = np.indices(scores.shape)
    elsewhere = float(
        scores[
            np.hypot(rows - row, columns - column) > SHARED_WALLS.repeat_distance_m * SHARED_WALLS.texels_per_metre
        ].max(initial=-1.0)
    )
    if (
        scores[row, column] < SHARED_WALLS.min_wall_correlation
        or elsewhere > SHARED_WALLS.max_repeat_ratio * scores[row, column]
    ):
        return None
    return column - right, row - down


def _match_patches(
    one: GradientImage, other: GradientImage, shift: tuple[int, int]
) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Positions (x, y) in texels of equal patches in both pictures."""
    import cv2

    height, width = one.slope.shape
    half, local, matches = (
        round(SHARED_WALLS.patch_side_m * SHARED_WALLS.texels_per_metre / 2),
        round(SHARED_WALLS.max_patch_offset_m * SHARED_WALLS.texels_per_metre),
        [],
    )
    for y in range(half, height - half + 1, half):
        for x in range(half, width - half + 1, half):
            window = slice(y - half, y + half), slice(x - half, x + half)
            patch = other.slope[window]
            left, top = (max(0, to + by - half - local) for to, by in zip((x, y), shift, strict=True))
            around = slice(top, y + shift[1] + half + local), slice(left, x + shift[0] + half + local)
            candidates = one.slope[around]
            if min(candidates.shape) < 2 * half + 3 or patch.std() < SHARED_WALLS.min_patch_contrast:
                continue
            if min(other.seen[window].mean(), one.seen[around].mean()) < SHARED_WALLS.min_patch_seen_share:
                continue
            correlations = cv2.matchTemplate(candidates, patch, cv2.TM_CCOEFF_NORMED)
            row, column = (int(window) for window in np.unravel_index(int(correlations.argmax()), correlations.shape))
            last = correlations.shape[0] - 1, correlations.shape[1] - 1
            if correlations[row, column] < SHARED_WALLS.min_patch_correlation or not (
                0 < row < last[0] and 0 < column < last[1]
            ):
                continue
            fine_x, fine_y = (
                _parabola_peak(correlations[row, column - 1 : column + 2]),
                _parabola_peak(correlations[row - 1 : row + 2, column]),
            )
            matches.append(((left + half + column + fine_x, top + half + row + fine_y), (float(x), float(y))))
    return matches


def _parabola_peak(three: NumericArray) -> float:
    """Peak of the parabola through three values, relative to the middle one."""
    low, middle, high = (float(value) for value in three)
    bend = low - 2 * middle + high
    return 0.5 * (low - high) / bend if bend < -1e-9 else 0.0


def _gradient_image(view: ChartView) -> GradientImage:
    import cv2

    grey = cv2.GaussianBlur(cv2.cvtColor(view.rgb, cv2.COLOR_RGB2GRAY).astype(np.float32), (0, 0), 1.0)
    seen = cv2.erode(view.seen.astype(np.uint8), np.ones((5, 5), np.uint8), borderValue=0) > 0
    return GradientImage(np.hypot(cv2.Sobel(grey, cv2.CV_32F, 1, 0), cv2.Sobel(grey, cv2.CV_32F, 0, 1)) * seen, seen)
