"""Whether materials repeat: the highest autocorrelation of plain ground and plain wall away from no shift at all."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely

from benchmarks.look.outputs import Output
from facade_core.geometry.charts import ChartKind

# Patches are looked at with so many pixels a metre, up to this side; shifts are this long, in metres: shorter than the first is
# grain, and shifts that leave less than this share of the patch over itself say nothing.
_PIXELS, _SIDE_M, SHIFTS_M, _OVERLAP = 8.0, 24.0, (0.8, 12.0), 0.3
# What changes slower than this is wear and light, not a material's picture.
_SLOW_M = 0.6
# Of the roadway: between its middle, where lanes are marked, and its edges.
_ROADWAY_M = (0.6, 2.4)
_PATCHES = 12
# Marks are so many times as bright as the roadway; what has less than this grain, in levels of grey, is the one colour of what
# stands against a neighbour, which nobody sees. Metres that are left out around both.
_MARK, _GRAIN, _AROUND_M = 1.3, 0.25, 0.5
# Metres around a shift out of which it stands.
_RING_M = 0.5
# A patch holds at least so many square metres.
_LEAST_M2 = 12.0


def repeats(output: Output) -> dict[str, Any]:
    """For ground of the roadway and walls of material alone, of the largest charts: the median and highest peak of single
    patches, which chance alone makes .2 of small ones, the one that all patches share, and that of a period, which stands out
    both ways."""
    area = output.charts.size.prod(axis=1)
    ground = np.flatnonzero(output.charts.kind == ChartKind.GROUND)
    return {
        "roadway": _peaks(output, ground[np.argsort(-area[ground])], _roadway),
        "plain_walls": _peaks(output, output.walls[np.argsort(-area[output.walls])], _plain),
    }


def _peaks(output: Output, charts: np.ndarray, mask_of: Any) -> dict[str, Any]:
    import cv2

    found: list[tuple[float, float, float]] = []
    maps: list[np.ndarray] = []
    pixels: tuple[int, np.ndarray] | None = None
    for chart in charts.tolist():
        if len(found) == _PATCHES:
            break
        mask = mask_of(output, chart)
        if mask is None or mask.sum() < _LEAST_M2 * _PIXELS**2:
            continue
        if pixels is None or pixels[0] != output.placement.page[chart]:
            pixels = (int(output.placement.page[chart]), output.pixels(int(output.placement.page[chart])))
        raster = output.raster(pixels[1], chart)
        whole = cv2.cvtColor(np.ascontiguousarray(raster), cv2.COLOR_RGB2GRAY).astype(np.float32)
        grey = cv2.resize(whole, _shape(output, chart)[::-1], interpolation=cv2.INTER_AREA)
        top, left = _densest(mask)
        side = int(_SIDE_M * _PIXELS)
        window = (slice(top, top + side), slice(left, left + side))
        likeness = autocorrelation(grey[window], material(grey[window], mask[window]))
        if likeness is not None and np.isfinite(likeness).any():
            maps.append(likeness)
            found.append(highest_peak(likeness))
    if not found:
        return {"patches": 0}
    values = [value for value, _, _ in found]
    worst = found[int(np.argmax(values))]
    shared, *shift = highest_peak(standing_out(np.array(maps)))
    period, *its = highest_peak(standing_out(np.array(maps), both=True))
    return {
        "patches": len(found),
        "shared": round(shared, 3),
        "its_shift_m": [round(value, 2) for value in shift],
        "period": round(period, 3),
        "shift_of_period_m": [round(value, 2) for value in its],
        "median": round(float(np.median(values)), 3),
        "highest": round(worst[0], 3),
        "shift_of_highest_m": [round(worst[1], 2), round(worst[2], 2)],
    }


def material(grey: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Where of a mask (h, w) grey shows a material's own texture: without marks on it, and without what has none."""
    import cv2

    if not mask.any():
        return mask
    fine = np.abs(grey - cv2.GaussianBlur(grey, (0, 0), 0.15 * _PIXELS))
    side = 2 * round(_AROUND_M * _PIXELS) + 1
    even = cv2.blur(fine, (side, side)) < _GRAIN
    out = mask & (grey > _MARK * np.median(grey[mask])) | even
    return mask & ~cv2.dilate(out.astype(np.uint8), np.ones((side, side), np.uint8)).astype(bool)


def autocorrelation(grey: np.ndarray, mask: np.ndarray) -> np.ndarray | None:
    """The normalised autocorrelation of the pixels (h, w) in a mask over shifts down and right of at most SHIFTS_M, (2 n + 1,
    2 n + 1), in its middle that of no shift; NaN where a shift is shorter or leaves too little. None if the mask is small."""
    import cv2

    if mask.sum() < _LEAST_M2 * _PIXELS**2:
        return None
    weight = mask.astype(np.float32)
    blurred = cv2.GaussianBlur(grey * weight, (0, 0), _SLOW_M * _PIXELS)
    own = cv2.GaussianBlur(weight, (0, 0), _SLOW_M * _PIXELS)
    detail = np.where(mask, grey - blurred / np.maximum(own, 1e-6), 0).astype(np.float64)
    reach = round(SHIFTS_M[1] * _PIXELS)
    shape = [2 * max(n, reach) + 1 for n in grey.shape]

    def correlated(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        found = np.fft.irfft2(np.fft.rfft2(a, shape) * np.conj(np.fft.rfft2(b, shape)), shape)
        return np.roll(found, (reach, reach), (0, 1))[: 2 * reach + 1, : 2 * reach + 1]

    over = correlated(weight, weight)
    squares = correlated(detail**2, weight)
    reverse = correlated(weight, detail**2)
    likeness = correlated(detail, detail) / np.sqrt(np.maximum(squares * reverse, 1e-12))
    metres = np.arange(-reach, reach + 1) / _PIXELS
    away = np.hypot(metres[:, None], metres[None])
    ask = (away >= SHIFTS_M[0]) & (away <= SHIFTS_M[1]) & (over > _OVERLAP * mask.sum())
    # what is all but even correlates with anything
    ask &= np.minimum(squares, reverse) > _OVERLAP / 2 * float((detail**2).sum())
    return np.where(ask, likeness, np.nan)


def standing_out(maps: np.ndarray, *, both: bool = False) -> np.ndarray:
    """By how much shifts stand out of those around them in the mean of autocorrelations (k, n, n), NaN if half are unknown.

    A material's period is the same in all patches; what two places of one share by chance is not. both: of those in their row
    and of those in their column; else of all around. A line that a wall has from side to side, and a streak, are like
    themselves however far they are shifted along, and of those shifts none stands out.
    """
    import cv2

    known = np.isfinite(maps)
    mean = np.where(known, maps, 0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    enough = known.sum(axis=0) >= len(maps) / 2
    weight = enough.astype(np.float64)
    wide = _RING_M * _PIXELS
    means = []
    for across, down in ((wide, 1e-6), (1e-6, wide)) if both else ((wide, wide),):
        around, own = (cv2.GaussianBlur(values, (0, 0), across, None, down) for values in (mean * weight, weight))
        means.append(around / np.maximum(own, 1e-9))
    return np.where(enough, mean - np.maximum.reduce(means), np.nan)


def highest_peak(likeness: np.ndarray) -> tuple[float, float, float]:
    """The highest value of a map of shifts (n, n), NaN left out, and that shift in metres right and down; 0 if all is NaN."""
    if not np.isfinite(likeness).any():
        return 0.0, 0.0, 0.0
    row, column = np.unravel_index(int(np.nanargmax(likeness)), likeness.shape)
    middle = len(likeness) // 2
    return float(likeness[row, column]), float(column - middle) / _PIXELS, float(row - middle) / _PIXELS


def _roadway(output: Output, chart: int) -> np.ndarray:
    """Where on a ground chart the roadway is, (h, w) bool."""
    height, width = _shape(output, chart)
    y, x = np.mgrid[:height, :width]
    size = output.charts.size[chart]
    points = output.charts.points(chart, (x + 0.5) * size[0] / width, (y + 0.5) * size[1] / height)
    lines = shapely.MultiLineString(output.streets)
    box = shapely.box(*points[..., :2].reshape(-1, 2).min(0), *points[..., :2].reshape(-1, 2).max(0))
    near = shapely.intersection(lines, box.buffer(_ROADWAY_M[1]))
    if near.is_empty:
        return np.zeros((height, width), bool)
    shapely.prepare(near)
    away = shapely.distance(near, shapely.points(points[..., :2].reshape(-1, 2))).reshape(height, width)
    return (away > _ROADWAY_M[0]) & (away < _ROADWAY_M[1])


def _plain(output: Output, chart: int) -> np.ndarray | None:
    """Where a wall is of its material alone, (h, w) bool; None where it is nowhere."""
    import cv2

    if "material" not in output.sources:
        return None
    plain = output.provenance(chart) == output.sources.index("material")
    if not plain.any():
        return None
    shape = _shape(output, chart)
    return cv2.resize(plain.astype(np.float32), shape[::-1], interpolation=cv2.INTER_AREA) > 0.999


def _shape(output: Output, chart: int) -> tuple[int, int]:
    width, height = output.charts.size[chart]
    return max(1, round(height * _PIXELS)), max(1, round(width * _PIXELS))


def _densest(mask: np.ndarray) -> tuple[int, int]:
    """The first row and column of the square of _SIDE_M that holds most of a mask."""
    import cv2

    side = int(_SIDE_M * _PIXELS)
    height, width = mask.shape
    total = cv2.integral(mask.astype(np.uint8))
    tops = np.arange(0, max(1, height - side + 1), side // 4)
    lefts = np.arange(0, max(1, width - side + 1), side // 4)
    bottoms, rights = np.minimum(tops + side, height), np.minimum(lefts + side, width)
    held = total[np.ix_(bottoms, rights)] - total[np.ix_(tops, rights)] - total[np.ix_(bottoms, lefts)]
    row, column = np.unravel_index(int((held + total[np.ix_(tops, lefts)]).argmax()), held.shape)
    return int(tops[row]), int(lefts[column])
