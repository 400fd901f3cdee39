"""Extend repetition grids into the hidden part of a facade at their own spacing, with attached balconies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int32Array
from facade_core.core.types import Element
from facade_core.facade.layout.grids import Grid, box_array
from facade_core.parsing.elements import split_balconies

# Relative difference of equal spacings; the far margin may bend the spacing by as much.
_SPACING_TOLERANCE = 0.12
# Most lines added at each end of a grid or in a gap.
_MAX_ADDED_LINES = 64


@dataclass(frozen=True, slots=True)
class ExtensionVariant:
    """Options of one variant of grid extension.

    Attributes
    ----------
    mirrored : mirror columns about the facade's middle before cells are filled.
    balanced : bend the spacing so that both margins agree.
    trim_row : omit the outermost new row.
    trim_column : omit the outermost new column.
    """

    mirrored: bool
    balanced: bool
    trim_row: bool
    trim_column: bool


@dataclass(frozen=True, slots=True, eq=False)
class ExtensionContext:
    """Facts shared by all extensions of one layout.

    Attributes
    ----------
    grids : repetition grids of the observed elements.
    widths : per grid, element width by column position.
    heights : per grid, element height by row position.
    balconies : attachment of balconies to windows, if any.
    """

    grids: Sequence[Grid]
    widths: Sequence[dict[float, float]]
    heights: Sequence[dict[float, float]]
    balconies: _BalconyAttachment | None


def extension_context(seen: Sequence[Element], fitted: Sequence[Grid]) -> ExtensionContext:
    """Collect the facts that extensions of one layout share.

    Parameters
    ----------
    seen : observed elements.
    fitted : grids of `seen`.
    """
    box = box_array(seen)
    side = (box[:, 2:] - box[:, :2]).tolist()
    return ExtensionContext(
        fitted,
        [{x: _median_side(side, grid.cells[:, k], 0) for k, x in enumerate(grid.columns)} for grid in fitted],
        [{y: _median_side(side, grid.cells[k], 1) for k, y in enumerate(grid.rows)} for grid in fitted],
        _fit_attachment(seen),
    )


def propose_extension_elements(
    context: ExtensionContext, domain: tuple[float, float, float, float], variant: ExtensionVariant
) -> Iterator[Element]:
    """Yield the elements that extended grids propose, in order of trust.

    Overlaps are not removed yet.
    """
    x0, y0, x1, y1 = domain
    balcony_of = context.balconies
    for label in ("window", "shop", "door", "balcony"):
        for number, grid in enumerate(context.grids):
            if grid.label != label:
                continue
            columns = extend_lines(grid.columns, grid.width, x0, x1, variant.balanced, variant.trim_column)
            if variant.mirrored or len(grid.columns) == 1:
                columns = add_mirror_columns(columns, grid.width, x0 + x1)
            # Doors and shops are on the ground, so only their own row is extended.
            rows = np.array(grid.rows)
            if label in ("window", "balcony"):
                rows = extend_lines(grid.rows, grid.height, y0, y1, False, variant.trim_row)
            if label == "door" and (grid.cells >= 0).sum() < 3 and not variant.mirrored:
                continue
            for e in _cell_elements(grid, context.widths[number], context.heights[number], rows, columns):
                yield e
                if label == "window" and balcony_of:
                    yield from _attached_balcony(e, balcony_of)


def extend_lines(
    positions_seen: Sequence[float], size: float, low: float, high: float, balanced: bool, trim: bool
) -> Float64Array:
    """Return line positions with gaps filled and both ends extended within [low, high].

    Parameters
    ----------
    positions_seen : ascending centres of the observed lines.
    size : extent of an element on a line.
    low, high : extent of the domain along this axis.
    balanced : bend the spacing so that both margins agree.
    trim : omit the outermost new line at both ends.

    Returns
    -------
    (K,) ascending centres.
    """
    spacing = np.diff(positions_seen)
    if not len(spacing):
        return np.array(positions_seen)
    pattern = _spacing_cycle(spacing)
    pitch = float(np.mean(pattern))
    positions = [positions_seen[0]]
    for p in positions_seen[1:]:
        gap = p - positions[-1]
        steps = round(gap / pitch)
        if (
            len(pattern) == 1
            and 1 < steps <= _MAX_ADDED_LINES
            and abs(gap / steps - pitch) <= _SPACING_TOLERANCE * pitch
        ):
            positions += [positions[-1] + gap * k / steps for k in range(1, steps)]
        positions.append(p)
    before, after = [], []
    at, k = positions[-1], 0
    while k < _MAX_ADDED_LINES and (at := at + pattern[(len(spacing) + k) % len(pattern)]) + size / 2 <= high:
        after.append(at)
        k += 1
    at, k = positions[0], 0
    while k < _MAX_ADDED_LINES and (at := at - pattern[(-1 - k) % len(pattern)]) - size / 2 >= low:
        before.append(at)
        k += 1
    if balanced and len(pattern) == 1:
        after = (
            bend_positions_to_target(positions[-1], after, high - (positions[0] - low), pitch) if not before else after
        )
        before = (
            bend_positions_to_target(positions[0], before, low + (high - positions[-1]), pitch) if not after else before
        )
    if trim:
        before, after = before[:-1], after[:-1]
    return np.array(before[::-1] + positions + after)


def _spacing_cycle(spacing: Float64Array) -> Float64Array:
    """Return the shortest cycle of 1 to 3 spacings that repeats from the first spacing on, else the median."""
    for period in (1, 2, 3):
        if len(spacing) > period:
            cycle = np.array([np.median(spacing[k::period]) for k in range(period)])
            error = np.abs(spacing - np.resize(cycle, len(spacing)))
            if (error <= _SPACING_TOLERANCE * spacing.mean()).all():
                return cycle
    # A missing cell makes a spacing too long, never too short, so the lower median is safer.
    return np.sort(spacing)[[(len(spacing) - 1) // 2]]


def bend_positions_to_target(start: float, new: list[float], target: float, pitch: float) -> list[float]:
    """Space new positions evenly up to `target`, if the pitch changes by little."""
    steps = round(abs(target - start) / pitch)
    if steps < 1 or abs(abs(target - start) / steps - pitch) > _SPACING_TOLERANCE * pitch:
        return new
    positions: list[float] = np.linspace(start, target, steps + 1)[1:].tolist()
    return positions


def add_mirror_columns(columns: Float64Array, width: float, twice_middle: float) -> Float64Array:
    """Add the mirror image of every column that overlaps no other column.

    Parameters
    ----------
    columns : (C,) column centres.
    width : width of an element.
    twice_middle : twice the x of the mirror axis.

    Returns
    -------
    Ascending centres.
    """
    mirror = twice_middle - columns
    free = np.abs(mirror[:, None] - columns).min(axis=1) >= width
    return np.sort(np.concatenate([columns, mirror[free]]))


def _cell_elements(
    grid: Grid, widths: dict[float, float], heights: dict[float, float], rows: Float64Array, columns: Float64Array
) -> Iterator[Element]:
    """Yield an element for every cell, in the width of its column and the height of its row where observed."""
    for y in rows.tolist():
        for x in columns.tolist():
            w, h = widths.get(x, grid.width) / 2, heights.get(y, grid.height) / 2
            yield Element(grid.label, x - w, y - h, x + w, y + h)


def _median_side(side: list[list[float]], cells: Int32Array, axis: int) -> float:
    middle: float = median(side[k][axis] for k in cells.tolist() if k >= 0)
    return middle


@dataclass(frozen=True, slots=True)
class _BalconyAttachment:
    windows: Float64Array
    has: BoolArray
    offset: tuple[float, float, float, float]


def _fit_attachment(seen: Sequence[Element]) -> _BalconyAttachment | None:
    """Measure which observed windows have a balcony and the median balcony box relative to the window's foot.

    Balconies that span several windows are split per window.
    """
    windows = box_array([e for e in seen if e.label == "window"])
    balconies = box_array([e for e in split_balconies(seen) if e.label == "balcony"])
    if not len(windows) or not len(balconies):
        return None
    middle = (windows[:, 0] + windows[:, 2]) / 2
    over = (balconies[:, None, 0] < middle) & (middle < balconies[:, None, 2])
    height = (windows[:, 3] - windows[:, 1])[None]
    reaches_foot = balconies[:, None, 3] > windows[:, 1] + 0.5 * height
    foot = reaches_foot & (balconies[:, None, 1] < windows[:, 3] + 0.3 * height)
    pairs = over & foot
    own = pairs & (pairs.sum(axis=1, keepdims=True) == 1)
    b, w = np.nonzero(own)
    if not len(b):
        return None
    foot_at = np.stack([middle, windows[:, 3]] * 2, axis=1)
    x0, y0, x1, y1 = np.median(balconies[b] - foot_at[w], axis=0).tolist()
    return _BalconyAttachment(windows, own.any(axis=0), (x0, y0, x1, y1))


def _attached_balcony(window: Element, known: _BalconyAttachment) -> Iterator[Element]:
    """Yield the balcony of a proposed window if most windows of its floor have one; of all floors if none is observed."""
    middle = (window.y0 + window.y1) / 2
    floor = (known.windows[:, 1] < middle) & (middle < known.windows[:, 3])
    seen = known.has[floor] if floor.any() else known.has
    if 2 * np.count_nonzero(seen) > len(seen):
        x, y = (window.x0 + window.x1) / 2, window.y1
        x0, y0, x1, y1 = known.offset
        yield Element("balcony", x + x0, y + y0, x + x1, y + y1)
