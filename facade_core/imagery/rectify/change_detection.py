"""What changed on a wall between two pictures of it: how much of what both show, light, shadow, season and pose aside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facade_core.core.errors import ImageError
from facade_core.imagery.rectify.fusion import ChartView

# Pixels a metre at which pictures are compared, at most: what is smaller than two of them is not told.
FINEST = 10.0
# How far a picture may lie beside the other for its pose, metres; and parts of it beside the whole.
SHIFT_M, BEND_M = 0.5, 0.2
# Standard deviations of the surroundings in which structure is compared, and of those in which a shift is found, metres.
AROUND_M, SHIFTED_M = 0.35, 1.2
# A cell counts as shown from this share of its texels on.
CLEAR = 0.9
# Added to colours, 0 to 1, before their logarithm; contrast (of logarithms) that is noise.
DARK, NOISE = 0.03, 0.06
# Natural logarithms of the ratios of red to green and blue to green that a camera's white balance and the light explain.
WHITE = 0.16
# A facade of which both pictures show less than this share is not compared.
LEAST_COMPARED = 0.1
# Changes smaller than this, square metres, are none.
LEAST_CHANGE_M2 = 0.25
# Where it changed is told by cells of so many metres, and no more than so many to a side.
CELL_M, MOST_CELLS = 0.5, 48
# The logistic regression of a cell's cues on whether it changed: `python -m benchmarks.changes --fit`.
WEIGHTS = (-7.658, 8.125, 9.972, 4.027, 24.696, 0.789, -6.487, -20.81)


@dataclass(frozen=True, slots=True, eq=False)
class ChangeMap:
    """share, of what both pictures show that is changed, None where that is too little to tell; compared, the share of the
    facade that both show; changed (h, w) bool, where; both (h, w) bool, where both show it."""

    changed_share: float | None
    compared_share: float
    is_changed: np.ndarray
    both: np.ndarray

    def by_cell(self, texels_per_metre: float) -> tuple[str, ...]:
        """Where it changed, by cells of half a metre or more, MOST_CELLS to a side at most: a text a row, from above, a letter
        a cell, from the left: tenths of what both show there that is changed, 0 to 9; "-" where both show less than half."""
        import cv2

        height, width = self.is_changed.shape
        cell = max(CELL_M * texels_per_metre, max(height, width) / MOST_CELLS)
        size = (max(1, round(width / cell)), max(1, round(height / cell)))
        both, changed = (
            cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_AREA)
            for mask in (self.both, self.is_changed)
        )
        tenths = np.clip(10 * changed / np.maximum(both, 1e-6), 0, 9).astype(int)
        return tuple(
            "".join(str(tenth) if shown >= 0.5 else "-" for tenth, shown in zip(row, seen, strict=True))
            for row, seen in zip(tenths.tolist(), both.tolist(), strict=True)
        )


def detect_changes(newer: ChartView, older: ChartView, texels_per_metre: float) -> ChangeMap:
    """Two views (h, w) of one facade compared. Raises ImageError for views of different sizes."""
    cues, both = change_cues(newer, older, texels_per_metre)
    compared = float(both.mean())
    size = newer.seen.shape
    if compared < LEAST_COMPARED:
        return ChangeMap(None, compared, np.zeros(size, bool), np.zeros(size, bool))
    changed = _changed(cues @ np.array(WEIGHTS[1:], np.float32) + WEIGHTS[0], both, size, texels_per_metre)
    import cv2

    whole, shown = (
        cv2.resize(cells.astype(np.uint8), size[::-1], interpolation=cv2.INTER_NEAREST).astype(bool)
        for cells in (changed, both)
    )
    return ChangeMap(float(changed.sum() / both.sum()), compared, whole, shown)


def _changed(logit: np.ndarray, both: np.ndarray, size: tuple[int, int], texels_per_metre: float) -> np.ndarray:
    """The cells (r, c) bool of what both show that are more likely changed than not, without specks."""
    import cv2

    weight = both.astype(np.float32)
    cell = size[0] / both.shape[0] / texels_per_metre
    sigma = 0.25 / cell
    logit = np.clip(logit, -6, 6) * weight
    smooth = cv2.GaussianBlur(logit, (0, 0), sigma) / np.maximum(cv2.GaussianBlur(weight, (0, 0), sigma), 1e-3)
    _, parts, boxes, _ = cv2.connectedComponentsWithStats(((smooth > 0) & both).astype(np.uint8))
    large = boxes[:, cv2.CC_STAT_AREA] * cell**2 >= LEAST_CHANGE_M2
    large[0] = False
    return large[parts]


def change_cues(newer: ChartView, older: ChartView, texels_per_metre: float) -> tuple[np.ndarray, np.ndarray]:
    """What tells of a change, by cell (r, c, k) float32, and the cells (r, c) bool that both views show.

    The cues: structure that differs (1 - correlation of logarithms, by how much contrast there is), edges that do, contrast
    that came or went, colour that white balance does not explain, brightness, and products of these.
    """
    if newer.seen.shape != older.seen.shape:
        raise ImageError("views of a facade differ in size; rectify them to one")
    first, second, own, other = _alike(newer, older, texels_per_metre)
    cell = newer.seen.shape[0] / first.shape[0] / texels_per_metre
    second, other = _aligned(first, second, own, other, cell)
    both = own & other
    weight = both.astype(np.float32)
    gain = _gain(first - second, both)
    second = second + gain
    tone, tone_other = first.mean(axis=2), second.mean(axis=2)
    around = AROUND_M / cell
    structure, energy, ratio = _correlation(tone, tone_other, weight, around)
    edges = _edges(tone, tone_other, weight, around)
    mean, mean_other = (_around(image * weight[..., None], weight, around) for image in (first, second))
    difference = mean - mean_other
    chroma = difference - difference.mean(axis=2, keepdims=True)
    chroma = np.sqrt((chroma**2).sum(axis=2))
    bright = np.abs(difference.mean(axis=2))
    meant = energy / (energy + NOISE)
    cues = [
        (1 - structure) * meant,
        (1 - edges) * meant,
        ratio * meant,
        np.minimum(chroma, 0.6),
        np.minimum(bright, 1.0),
    ]
    cues += [cues[0] * cues[1], cues[0] * cues[3]]
    return np.stack(cues, axis=2).astype(np.float32), both


def _alike(newer: ChartView, older: ChartView, texels_per_metre: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Both as logarithms of colours (r, c, 3) float32 in cells that the coarser one still resolves, and what each shows."""
    import cv2

    rows, columns = newer.seen.shape
    shown = [float(np.median(v.quality[v.clear])) if v.clear.any() else 1.0 for v in (newer, older)]
    share = min(1.0, FINEST / texels_per_metre, max(0.1, min(shown)))
    size = (max(8, round(columns * share)), max(8, round(rows * share)))
    found, clear = [], []
    for view in (newer, older):
        mask = view.clear.astype(np.float32)
        inside = cv2.resize(mask, size, interpolation=cv2.INTER_AREA)
        colour = cv2.resize(view.rgb * mask[..., None] / np.float32(255), size, interpolation=cv2.INTER_AREA)
        colour = colour / np.maximum(inside, 1e-3)[..., None]
        found.append(np.log(colour + np.float32(DARK)))
        clear.append(inside >= CLEAR)
    return found[0], found[1], clear[0], clear[1]


def _aligned(
    first: np.ndarray, second: np.ndarray, own: np.ndarray, other: np.ndarray, cell: float
) -> tuple[np.ndarray, np.ndarray]:
    """The second picture and what it shows, laid over the first: shifted as a whole, then parts of it a little more."""
    most, more = max(1, round(SHIFT_M / cell)), max(1, round(BEND_M / cell))
    one, two = _edge_field(first.mean(axis=2)), _edge_field(second.mean(axis=2))
    reach = range(-most, most + 1)
    scores = {(dy, dx): _match(one, two, own, other, dy, dx) for dy in reach for dx in reach}
    best = max(scores, key=lambda shift: (scores[shift], -abs(shift[0]) - abs(shift[1])))
    second, other = _shifted(second, *best), _shifted(other, *best)
    two = _shifted(two, *best)
    sigma = SHIFTED_M / cell
    shifts = [(dy, dx) for dy in range(-more, more + 1) for dx in range(-more, more + 1)]
    local = np.stack([_local(one, _shifted(two, dy, dx), own & _shifted(other, dy, dx), sigma) for dy, dx in shifts])
    # no shift unless it is better by more than noise
    local[[k for k, shift in enumerate(shifts) if shift != (0, 0)]] -= 0.02
    chosen = local.argmax(axis=0)
    bent, seen = np.zeros_like(second), np.zeros_like(other)
    for k, (dy, dx) in enumerate(shifts):
        here = chosen == k
        if here.any():
            bent[here], seen[here] = _shifted(second, dy, dx)[here], _shifted(other, dy, dx)[here]
    return bent, seen


def _edge_field(tone: np.ndarray) -> np.ndarray:
    """Gradients (r, c, 2) of a picture, the strong ones cut to little more than the weak."""
    import cv2

    field = (
        np.stack([cv2.Sobel(tone, cv2.CV_32F, 1, 0, ksize=3), cv2.Sobel(tone, cv2.CV_32F, 0, 1, ksize=3)], axis=2) / 8
    )
    return field / (np.linalg.norm(field, axis=2, keepdims=True) + NOISE)


def _match(one: np.ndarray, two: np.ndarray, own: np.ndarray, other: np.ndarray, dy: int, dx: int) -> float:
    both = own & _shifted(other, dy, dx)
    if both.sum() < max(1, 0.5 * min(own.sum(), other.sum())):
        return -1.0
    two = _shifted(two, dy, dx)
    return float((one * two).sum(axis=2)[both].mean())


def _local(one: np.ndarray, two: np.ndarray, both: np.ndarray, sigma: float) -> np.ndarray:
    import cv2

    product = (one * two).sum(axis=2) * both
    return np.asarray(
        cv2.GaussianBlur(product, (0, 0), sigma) / (cv2.GaussianBlur(both.astype(np.float32), (0, 0), sigma) + 0.05)
    )


def _shifted(image: np.ndarray, dy: int, dx: int) -> np.ndarray:
    """An image moved down and right; what comes in is zero."""
    moved = np.zeros_like(image)
    rows, columns = image.shape[:2]
    to = (slice(max(dy, 0), rows + min(dy, 0)), slice(max(dx, 0), columns + min(dx, 0)))
    at = (slice(max(-dy, 0), rows + min(-dy, 0)), slice(max(-dx, 0), columns + min(-dx, 0)))
    moved[to] = image[at]
    return moved


def _gain(difference: np.ndarray, both: np.ndarray) -> np.ndarray:
    """What the second picture's exposure and white balance are off (3,), as logarithms: the latter within WHITE."""
    if not both.any():
        return np.zeros(3, np.float32)
    found = np.median(difference[both], axis=0)
    return np.asarray(found.mean() + np.clip(found - found.mean(), -WHITE, WHITE), np.float32)


def _around(values: np.ndarray, weight: np.ndarray, sigma: float) -> np.ndarray:
    """Weighted means around each cell of values that are multiplied by their weights already."""
    import cv2

    total = np.maximum(cv2.GaussianBlur(weight, (0, 0), sigma), 1e-4)
    mean = cv2.GaussianBlur(values, (0, 0), sigma)
    return np.asarray(mean / (total[..., None] if values.ndim == 3 else total))


def _correlation(
    one: np.ndarray, two: np.ndarray, weight: np.ndarray, sigma: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Correlation around each cell, the larger contrast of both, and the logarithm of their ratio."""
    mean, mean_two = (_around(v * weight, weight, sigma) for v in (one, two))
    spread, spread_two = (
        np.sqrt(np.maximum(_around(v * v * weight, weight, sigma) - m * m, 0))
        for v, m in ((one, mean), (two, mean_two))
    )
    covariance = _around(one * two * weight, weight, sigma) - mean * mean_two
    correlation = covariance / (spread * spread_two + NOISE**2)
    ratio = np.abs(np.log((spread + NOISE) / (spread_two + NOISE)))
    return np.clip(correlation, -1, 1), np.maximum(spread, spread_two), ratio


def _edges(one: np.ndarray, two: np.ndarray, weight: np.ndarray, sigma: float) -> np.ndarray:
    """How alike edges around each cell are, -1 to 1: of the angles between gradients, by their strength."""
    a, b = _edge_field(one), _edge_field(two)
    dot = _around((a * b).sum(axis=2) * weight, weight, sigma)
    power = [_around((f * f).sum(axis=2) * weight, weight, sigma) for f in (a, b)]
    return np.asarray(np.clip(dot / (np.sqrt(power[0] * power[1]) + 0.02), -1, 1))
