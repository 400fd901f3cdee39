"""Change detection between two pictures of a wall, robust to light, shadow, season and pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import AnyArray, BoolArray, Float32Array, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.imagery.rectify.fusion import ChartView

# Density at which pictures are compared at most; details below two cells are not resolved.
MAX_CELLS_PER_METRE = 10.0
# Largest offset in metres between the pictures from pose errors,
MAX_SHIFT_M = 0.5
# and of parts against the whole.
MAX_LOCAL_SHIFT_M = 0.2
# Standard deviation in metres of the windows in which structure is compared,
STRUCTURE_SIGMA_M = 0.35
# and of those in which a local shift is found.
SHIFT_SIGMA_M = 1.2
# Share of its texels from which a cell counts as visible.
MIN_CLEAR_SHARE = 0.9
# Added to colours, 0 to 1, before their logarithm.
LOG_OFFSET = 0.03
# Contrast of logarithms that is noise.
NOISE_CONTRAST = 0.06
# Log ratios of red and blue to green that white balance and light explain.
MAX_WHITE_BALANCE_LOG = 0.16
# A facade is compared if both pictures show this share of it.
MIN_COMPARED_SHARE = 0.1
# Smaller changes, in square metres, are ignored.
MIN_CHANGE_M2 = 0.25
# Side in metres of the cells that report changes,
REPORT_CELL_M = 0.5
# and their number along a side at most.
MAX_REPORT_CELLS = 48
# Logistic regression of a cell's change on its cues, fitted by `python -m benchmarks.changes --fit`.
LOGISTIC_WEIGHTS = (-7.658, 8.125, 9.972, 4.027, 24.696, 0.789, -6.487, -20.81)


@dataclass(frozen=True, slots=True, eq=False)
class ChangeMap:
    """Changes between two pictures of a facade.

    Attributes
    ----------
    changed_share : changed share of the compared area, None where that is too small.
    compared_share : share of the facade that both pictures show.
    is_changed : (h, w) bool.
    is_compared : (h, w) bool, both pictures show the texel.
    """

    changed_share: float | None
    compared_share: float
    is_changed: BoolArray
    is_compared: BoolArray

    def encode_cells(self, texels_per_metre: float) -> tuple[str, ...]:
        """Encode the changes by cells of half a metre or more, at most MAX_REPORT_CELLS to a side.

        Returns
        -------
        One text per row from the top, one character per cell from the left: changed tenths of the compared area, 0 to
        9, or "-" where less than half of the cell is compared.
        """
        import cv2

        height, width = self.is_changed.shape
        cell = max(REPORT_CELL_M * texels_per_metre, max(height, width) / MAX_REPORT_CELLS)
        size = (max(1, round(width / cell)), max(1, round(height / cell)))
        both, changed = (
            cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_AREA)
            for mask in (self.is_compared, self.is_changed)
        )
        tenths = np.clip(10 * changed / np.maximum(both, 1e-6), 0, 9).astype(int)
        return tuple(
            "".join(str(tenth) if shown >= 0.5 else "-" for tenth, shown in zip(row, seen, strict=True))
            for row, seen in zip(tenths.tolist(), both.tolist(), strict=True)
        )


class ChangeSinceCapture(NamedTuple):
    """Change of a facade since an earlier capture.

    Attributes
    ----------
    changed : changed share of the part that both captures show; None if that is too small.
    compared : share of the facade that both show.
    day : day of the newest picture of the earlier capture.
    cells : changed cells.
    picture : small picture of the facade before, if enough changed.
    """

    changed: float | None
    compared: float
    day: str | None
    cells: tuple[str, ...] = ()
    picture: UInt8Array | None = None


def detect_changes(newer: ChartView, older: ChartView, texels_per_metre: float) -> ChangeMap:
    """Detect changes between two views of one facade.

    Parameters
    ----------
    newer, older : views of equal size.
    texels_per_metre : density of the views.

    Raises
    ------
    ImageError
        If the sizes differ.
    """
    cues, both = change_cues(newer, older, texels_per_metre)
    compared_share = float(both.mean())
    size = newer.seen.shape
    if compared_share < MIN_COMPARED_SHARE:
        return ChangeMap(None, compared_share, np.zeros(size, bool), np.zeros(size, bool))
    changed = _changed_cells(
        (cues * np.array(LOGISTIC_WEIGHTS[1:], np.float32)).sum(axis=-1) + LOGISTIC_WEIGHTS[0],
        both,
        size,
        texels_per_metre,
    )
    import cv2

    is_changed, is_compared = (
        cv2.resize(cells.astype(np.uint8), size[::-1], interpolation=cv2.INTER_NEAREST).astype(bool)
        for cells in (changed, both)
    )
    return ChangeMap(float(changed.sum() / both.sum()), compared_share, is_changed, is_compared)


def _changed_cells(logit: Float32Array, both: BoolArray, size: tuple[int, int], texels_per_metre: float) -> BoolArray:
    """Cells (r, c) bool that are more likely changed than not, without specks."""
    import cv2

    weight = both.astype(np.float32)
    cell = size[0] / both.shape[0] / texels_per_metre
    sigma = 0.25 / cell
    logit = np.clip(logit, -6, 6) * weight
    smooth = cv2.GaussianBlur(logit, (0, 0), sigma) / np.maximum(cv2.GaussianBlur(weight, (0, 0), sigma), 1e-3)
    _, parts, boxes, _ = cv2.connectedComponentsWithStats(((smooth > 0) & both).astype(np.uint8))
    large = boxes[:, cv2.CC_STAT_AREA] * cell**2 >= MIN_CHANGE_M2
    large[0] = False
    is_changed: BoolArray = large[parts]
    return is_changed


def change_cues(newer: ChartView, older: ChartView, texels_per_metre: float) -> tuple[Float32Array, BoolArray]:
    """Compute the cues of a change by cell.

    The cues are: structure (1 - correlation of logarithms, weighted by contrast), edges, contrast ratio, colour beyond
    white balance, brightness, and products of these.

    Parameters
    ----------
    newer, older : views of equal size.
    texels_per_metre : density of the views.

    Returns
    -------
    (r, c, k) float32 cues, and (r, c) bool cells that both views show.

    Raises
    ------
    ImageError
        If the sizes differ.
    """
    if newer.seen.shape != older.seen.shape:
        raise ImageError("views of a facade differ in size; rectify them to one")
    first, second, clear, clear_other = _common_resolution(newer, older, texels_per_metre)
    cell = newer.seen.shape[0] / first.shape[0] / texels_per_metre
    second, clear_other = _align(first, second, clear, clear_other, cell)
    both = clear & clear_other
    weight = both.astype(np.float32)
    gain = _exposure_gain(first - second, both)
    second = second + gain
    tone, tone_other = first.mean(axis=2), second.mean(axis=2)
    sigma = STRUCTURE_SIGMA_M / cell
    structure, energy, ratio = _local_correlation(tone, tone_other, weight, sigma)
    edges = _edge_similarity(tone, tone_other, weight, sigma)
    mean, mean_other = (_local_mean(image * weight[..., None], weight, sigma) for image in (first, second))
    difference = mean - mean_other
    chroma = difference - difference.mean(axis=2, keepdims=True)
    chroma = np.sqrt((chroma**2).sum(axis=2))
    bright = np.abs(difference.mean(axis=2))
    contrast_weight = energy / (energy + NOISE_CONTRAST)
    cues = [
        (1 - structure) * contrast_weight,
        (1 - edges) * contrast_weight,
        ratio * contrast_weight,
        np.minimum(chroma, 0.6),
        np.minimum(bright, 1.0),
    ]
    cues += [cues[0] * cues[1], cues[0] * cues[3]]
    return np.stack(cues, axis=2).astype(np.float32), both


def _common_resolution(
    newer: ChartView, older: ChartView, texels_per_metre: float
) -> tuple[Float32Array, Float32Array, BoolArray, BoolArray]:
    """Log colours (r, c, 3) float32 of both views in cells that the coarser one resolves, and their visible cells."""
    import cv2

    rows, columns = newer.seen.shape
    qualities = [float(np.median(v.quality[v.clear])) if v.clear.any() else 1.0 for v in (newer, older)]
    share = min(1.0, MAX_CELLS_PER_METRE / texels_per_metre, max(0.1, min(qualities)))
    size = (max(8, round(columns * share)), max(8, round(rows * share)))
    log_colours, clear = [], []
    for view in (newer, older):
        mask = view.clear.astype(np.float32)
        clear_share = cv2.resize(mask, size, interpolation=cv2.INTER_AREA)
        colour = cv2.resize(view.rgb * mask[..., None] / np.float32(255), size, interpolation=cv2.INTER_AREA)
        colour = colour / np.maximum(clear_share, 1e-3)[..., None]
        log_colours.append(np.log(colour + np.float32(LOG_OFFSET)))
        clear.append(clear_share >= MIN_CLEAR_SHARE)
    return log_colours[0], log_colours[1], clear[0], clear[1]


def _align(
    first: Float32Array, second: Float32Array, clear: BoolArray, clear_other: BoolArray, cell: float
) -> tuple[Float32Array, BoolArray]:
    """Second picture and its visible cells, aligned to the first: shifted as a whole, then locally."""
    max_shift, max_local_shift = max(1, round(MAX_SHIFT_M / cell)), max(1, round(MAX_LOCAL_SHIFT_M / cell))
    one, two = _edge_field(first.mean(axis=2)), _edge_field(second.mean(axis=2))
    reach = range(-max_shift, max_shift + 1)
    scores = {(dy, dx): _shift_score(one, two, clear, clear_other, dy, dx) for dy in reach for dx in reach}
    best = max(scores, key=lambda shift: (scores[shift], -abs(shift[0]) - abs(shift[1])))
    second, clear_other = _shift_image(second, *best), _shift_image(clear_other, *best)
    two = _shift_image(two, *best)
    sigma = SHIFT_SIGMA_M / cell
    shifts = [
        (dy, dx)
        for dy in range(-max_local_shift, max_local_shift + 1)
        for dx in range(-max_local_shift, max_local_shift + 1)
    ]
    local = np.stack(
        [
            _local_shift_scores(one, _shift_image(two, dy, dx), clear & _shift_image(clear_other, dy, dx), sigma)
            for dy, dx in shifts
        ]
    )
    # a shift must improve the score by more than noise
    local[[k for k, shift in enumerate(shifts) if shift != (0, 0)]] -= 0.02
    chosen = local.argmax(axis=0)
    aligned, clear_aligned = np.zeros_like(second), np.zeros_like(clear_other)
    for k, (dy, dx) in enumerate(shifts):
        here = chosen == k
        if here.any():
            aligned[here], clear_aligned[here] = (
                _shift_image(second, dy, dx)[here],
                _shift_image(clear_other, dy, dx)[here],
            )
    return aligned, clear_aligned


def _edge_field(tone: Float32Array) -> Float32Array:
    """Gradients (r, c, 2) of a picture, with strong ones compressed."""
    import cv2

    field = (
        np.stack([cv2.Sobel(tone, cv2.CV_32F, 1, 0, ksize=3), cv2.Sobel(tone, cv2.CV_32F, 0, 1, ksize=3)], axis=2) / 8
    )
    edge_field: Float32Array = field / (np.linalg.norm(field, axis=2, keepdims=True) + NOISE_CONTRAST)
    return edge_field


def _shift_score(
    one: Float32Array, two: Float32Array, clear: BoolArray, clear_other: BoolArray, dy: int, dx: int
) -> float:
    both = clear & _shift_image(clear_other, dy, dx)
    if both.sum() < max(1, 0.5 * min(clear.sum(), clear_other.sum())):
        return -1.0
    two = _shift_image(two, dy, dx)
    return float((one * two).sum(axis=2)[both].mean())


def _local_shift_scores(one: Float32Array, two: Float32Array, both: BoolArray, sigma: float) -> Float32Array:
    import cv2

    product = (one * two).sum(axis=2) * both
    return np.asarray(
        cv2.GaussianBlur(product, (0, 0), sigma) / (cv2.GaussianBlur(both.astype(np.float32), (0, 0), sigma) + 0.05)
    )


def _shift_image(image: AnyArray, dy: int, dx: int) -> AnyArray:
    """Image shifted down and right, filled with zero."""
    moved = np.zeros_like(image)
    rows, columns = image.shape[:2]
    target = (slice(max(dy, 0), rows + min(dy, 0)), slice(max(dx, 0), columns + min(dx, 0)))
    source = (slice(max(-dy, 0), rows + min(-dy, 0)), slice(max(-dx, 0), columns + min(-dx, 0)))
    moved[target] = image[source]
    return moved


def _exposure_gain(difference: Float32Array, both: BoolArray) -> Float32Array:
    """Log gain (3,) between the exposures and white balances, the latter within MAX_WHITE_BALANCE_LOG."""
    if not both.any():
        return np.zeros(3, np.float32)
    medians = np.median(difference[both], axis=0)
    return np.asarray(
        medians.mean() + np.clip(medians - medians.mean(), -MAX_WHITE_BALANCE_LOG, MAX_WHITE_BALANCE_LOG), np.float32
    )


def _local_mean(values: Float32Array, weight: Float32Array, sigma: float) -> Float32Array:
    """Weighted mean around each cell of values that are already multiplied by their weights."""
    import cv2

    total = np.maximum(cv2.GaussianBlur(weight, (0, 0), sigma), 1e-4)
    mean = cv2.GaussianBlur(values, (0, 0), sigma)
    return np.asarray(mean / (total[..., None] if values.ndim == 3 else total))


def _local_correlation(
    one: Float32Array, two: Float32Array, weight: Float32Array, sigma: float
) -> tuple[Float32Array, Float32Array, Float32Array]:
    """Correlation around each cell, the larger contrast of both, and the logarithm of their ratio."""
    mean, mean_two = (_local_mean(v * weight, weight, sigma) for v in (one, two))
    spread, spread_two = (
        np.sqrt(np.maximum(_local_mean(v * v * weight, weight, sigma) - m * m, 0))
        for v, m in ((one, mean), (two, mean_two))
    )
    covariance = _local_mean(one * two * weight, weight, sigma) - mean * mean_two
    correlation = covariance / (spread * spread_two + NOISE_CONTRAST**2)
    ratio = np.abs(np.log((spread + NOISE_CONTRAST) / (spread_two + NOISE_CONTRAST)))
    return np.clip(correlation, -1, 1), np.maximum(spread, spread_two), ratio


def _edge_similarity(one: Float32Array, two: Float32Array, weight: Float32Array, sigma: float) -> Float32Array:
    """Similarity of edges around each cell, -1 to 1: the angle between gradients, weighted by their strength."""
    a, b = _edge_field(one), _edge_field(two)
    dot = _local_mean((a * b).sum(axis=2) * weight, weight, sigma)
    power = [_local_mean((f * f).sum(axis=2) * weight, weight, sigma) for f in (a, b)]
    return np.asarray(np.clip(dot / (np.sqrt(power[0] * power[1]) + 0.02), -1, 1))
