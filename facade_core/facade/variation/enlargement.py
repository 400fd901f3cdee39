"""Enlarge a facade to more floors or columns: repeat bands of the wall and the elements on them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import Float64Array, Int32Array, Int64Array, IntArray, StringArray, UInt8Array
from facade_core.core.errors import LayoutError
from facade_core.facade.variation.contents import ElementGroup
from facade_core.facade.variation.rendering import element_boxes

# Width of the fade between bands of the wall.
_FADE_PX = 4
# Labels that repeated bands avoid, as long as there are other bands.
_UNREPEATED_LABELS = ("door", "shop")


class EnlargedFacade(NamedTuple):
    """Enlarged wall and the elements on it.

    Attributes
    ----------
    wall : (H', W', 3) uint8.
    places : (M,) int element that each box is a copy of.
    boxes : (M, 4) int32.
    """

    wall: UInt8Array
    places: Int64Array
    boxes: Int32Array


def enlarge_facade(
    wall: UInt8Array,
    groups: Sequence[ElementGroup],
    cells: Sequence[Int32Array],
    floors: int | None,
    columns: int | None,
    rng: np.random.Generator,
) -> EnlargedFacade:
    """Repeat inner floors and bays of the largest window grid up to the wanted counts.

    An element that spans several bands, such as a running balcony, is stretched.

    Parameters
    ----------
    wall : (H, W, 3) uint8 wall without elements.
    groups : elements by label and size.
    cells : per grid, element numbers, -1 for none.
    floors, columns : wanted counts, None to keep the present one.
    rng : draws the repeated bands.

    Raises
    ------
    LayoutError
        For fewer floors or columns than present, or without windows.
    """
    boxes = element_boxes(groups)
    labels = np.array([g.label for g in groups for _ in g.boxes])
    grid = max((c for c in cells if labels[c.max()] == "window"), key=lambda c: (c >= 0).sum(), default=None)
    if grid is None:
        raise LayoutError("this facade has no window to repeat; sample it without floors and columns")
    lines = []
    for axis, wanted, name in ((1, floors, "floors"), (0, columns, "columns")):
        along = grid if axis else grid.T
        have = len(along)
        if wanted is not None and wanted < have:
            raise LayoutError(f"{name}={wanted}: this facade has {have}; pass at least as many")
        rows = np.array([np.median(boxes[r[r >= 0]][:, [axis, axis + 2]], axis=0) for r in along])
        lines.append(_repeat_bands(rows, boxes, labels, axis, (wanted or have) - have, wall.shape[1 - axis], rng))
    (down, tall), (across, wide) = lines
    spliced = _splice(_splice(wall, down, 0), across, 1)
    places, found = [], []
    for i in range(len(boxes)):
        for y0, y1 in tall[i]:
            for x0, x1 in wide[i]:
                places.append(i)
                found.append((x0, y0, x1, y1))
    return EnlargedFacade(spliced, np.array(places), np.array(found, np.int32))


def _repeat_bands(
    rows: Float64Array,
    boxes: IntArray,
    labels: StringArray,
    axis: int,
    more: int,
    length: int,
    rng: np.random.Generator,
) -> tuple[Int64Array, list[list[tuple[int, int]]]]:
    """Return source positions of the enlarged axis, and each element's intervals on it.

    Parameters
    ----------
    rows : (R, 2) first and last position of the grid's rows.
    more : number of bands to add.
    """
    spans = np.clip(boxes[:, [axis, axis + 2]], 0, length)
    cuts = [0, *_find_cuts(rows, spans, length), length]
    bands = list(range(1, len(cuts) - 2))
    once = np.isin(labels, _UNREPEATED_LABELS)
    middles = spans.mean(axis=1)
    plain = [b for b in bands if not ((middles >= cuts[b]) & (middles < cuts[b + 1]) & once).any()]
    # A facade of one row has no inner band; the band of that row, up to the edge, is repeated.
    own = np.unique(np.searchsorted(cuts, rows.mean(axis=1), "right") - 1).tolist()
    extra = _draw_bands(plain or bands or own, more, rng)
    order = np.sort(np.concatenate([np.arange(len(cuts) - 1), extra])).astype(int)
    starts = np.cumsum([0, *(cuts[b + 1] - cuts[b] for b in order)])
    source = np.concatenate([np.arange(cuts[b], cuts[b + 1]) for b in order])
    intervals = []
    for (first, last), middle in zip(boxes[:, [axis, axis + 2]].tolist(), middles, strict=True):
        low, high = (int(np.searchsorted(cuts, v, "right")) - 1 for v in (first + 0.25 * (middle - first), middle))
        top = int(np.searchsorted(cuts, last - 0.25 * (last - middle), "right")) - 1
        low, top = max(low, 0), min(top, len(cuts) - 2)
        if low == top:
            copies = np.flatnonzero(order == high)
            intervals.append(
                [(int(first + starts[c] - cuts[high]), int(last + starts[c] - cuts[high])) for c in copies]
            )
        else:
            begin = first + starts[np.flatnonzero(order == low)[0]] - cuts[low]
            end = last + starts[np.flatnonzero(order == top)[-1]] - cuts[top]
            intervals.append([(int(begin), int(end))])
    return source, intervals


def _find_cuts(rows: Float64Array, spans: IntArray, length: int) -> list[int]:
    """Return the positions between rows that the fewest elements cross, and one pitch before and after."""
    found = []
    for (_, end), (start, _) in zip(rows[:-1], rows[1:], strict=True):
        low, high = sorted((round(end), round(start)))
        at = np.arange(low, max(high, low + 1) + 1)
        crossed = ((spans[:, :1] < at) & (at < spans[:, 1:])).sum(axis=0)
        found.append(int(at[np.lexsort((np.abs(at - at.mean()), crossed))[0]]))
    size = np.median(rows[:, 1] - rows[:, 0])
    pitch = np.median(np.diff(rows.mean(axis=1))) if len(rows) > 1 else 1.8 * size
    if not found:
        found = [round(rows[0].mean() + pitch / 2)]
    before, behind = found[0] - round(pitch), found[-1] + round(pitch)
    if before >= 0 and before <= rows[0, 0]:
        found.insert(0, before)
    if behind <= length and behind >= rows[-1, 1] and len(rows) > 1:
        found.append(behind)
    return sorted({min(max(c, 1), length - 1) for c in found})


def _draw_bands(bands: Sequence[int], number: int, rng: np.random.Generator) -> Int64Array:
    """Draw `number` of the bands, each about equally often."""
    if number == 0:
        return np.zeros(0, int)
    return np.concatenate([rng.permutation(bands) for _ in range(-(-number // len(bands)))])[:number]


def _splice(wall: UInt8Array, source: Int64Array, axis: int) -> UInt8Array:
    """Take the lines `source` of the wall along an axis and fade between lines that are not successive."""
    if axis:
        return np.ascontiguousarray(_splice(wall.swapaxes(0, 1), source, 0).swapaxes(0, 1))
    result = wall[source]
    for at in np.flatnonzero(np.diff(source) != 1) + 1:
        step = np.arange(-_FADE_PX, _FADE_PX)
        step = step[(at + step >= 0) & (at + step < len(source))]
        share = ((step + _FADE_PX + 0.5) / (2 * _FADE_PX))[:, None, None]
        before = wall[np.clip(source[at - 1] + 1 + step, 0, len(wall) - 1)]
        behind = wall[np.clip(source[at] + step, 0, len(wall) - 1)]
        result[at + step] = ((1 - share) * before + share * behind).round().astype(np.uint8)
    return result
