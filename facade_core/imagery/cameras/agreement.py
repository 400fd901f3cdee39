"""Agreement of several camera views of one surface: mean colours of squares, and thin objects in single views."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, UInt8Array
from facade_core.core.levelling import fill_unknown_values
from facade_core.imagery.cameras.settings import AGREEMENT
from facade_core.imagery.rectify.fusion import ChartView, square_means


class ViewAgreementBySquares(NamedTuple):
    """Agreement of n views of one surface in mean colour, square by square.

    Attributes
    ----------
    side : side of a square in texels.
    is_usable : (n, r, c) bool, enough of the square is clear.
    is_confirmed : (n, r, c) bool, another view agrees.
    is_contradicted : (n, r, c) bool, another view disagrees.
    log_colour : (n, r, c, 3) logarithm of the mean colour.
    """

    side: int
    is_usable: BoolArray
    is_confirmed: BoolArray
    is_contradicted: BoolArray
    log_colour: Float32Array

    def find_unconfirmed_squares(self, view: int) -> BoolArray:
        """Return the squares (r, c) bool that only this view shows."""
        is_unconfirmed: BoolArray = self.is_usable[view] & ~self.is_confirmed[view] & ~self.is_contradicted[view]
        return is_unconfirmed


def compare_views_by_squares(views: Sequence[ChartView], density: float) -> ViewAgreementBySquares:
    """Compare the mean colours of squares between views of one exposure.

    A view agrees with another view that shows its colour in the same or a neighbouring square: poses may be off by one
    square.

    Parameters
    ----------
    views : views of one chart, of equal size.
    density : texels per metre.

    Returns
    -------
    The agreement of every view with the others.
    """
    side = max(1, round(AGREEMENT.compared_square_m * density))
    colours, shares = zip(*(mean_log_colour(view.rgb, view.clear, side) for view in views), strict=True)
    is_usable, log_colour = np.stack(shares) > AGREEMENT.min_clear_share, np.stack(colours)
    is_confirmed, is_contradicted = np.zeros(is_usable.shape, bool), np.zeros(is_usable.shape, bool)
    for i in range(len(views)):
        for j in range(len(views)):
            if i == j:
                continue
            both = is_usable[i] & is_usable[j]
            agree = (
                both
                & _has_match(log_colour[i], log_colour[j], is_usable[j])
                & _has_match(log_colour[j], log_colour[i], is_usable[i])
            )
            is_confirmed[i] |= agree
            is_contradicted[i] |= both & ~agree
    return ViewAgreementBySquares(side, is_usable, is_confirmed, is_contradicted, log_colour)


def find_thin_objects(views: Sequence[ChartView], density: float) -> list[BoolArray]:
    """Mask texels of each view that contrast with their surroundings and that no other view confirms.

    Parameters
    ----------
    views : views of one chart, of equal size and exposure.
    density : texels per metre.

    Returns
    -------
    One mask (h, w) bool per view, with a rim.
    """
    side = _thin_side(density)
    cells = [_find_thin_cells(view, side) for view in views]
    masks = []
    for i, view in enumerate(views):
        is_thin = cells[i].is_thin
        for j, other in enumerate(cells):
            box = _bounding_box(is_thin, AGREEMENT.thin_rim_cells)
            if j != i and other.is_usable[box].any():
                is_thin[box] &= ~_has_match(
                    cells[i].log_colour[box], other.log_colour[box], other.is_usable[box], AGREEMENT.thin_rim_cells
                )
        masks.append(squares_to_texels(grow_mask(is_thin, AGREEMENT.thin_rim_cells), side, view.seen.shape))
    return masks


def find_ground_lines(views: Sequence[ChartView], feet: Sequence[Float64Array], density: float) -> list[BoolArray]:
    """Mask texels of each view of level ground that lie on it as lines: paint, rails, kerbs.

    In a view, an upright object is a line away from the point below the camera. Other lines lie on the ground, unless another
    camera shows that place without a line.

    Parameters
    ----------
    views : views of one chart, of equal size and exposure.
    feet : (2,) column and row of the texel below each camera, in or beside the chart.
    density : texels per metre.

    Returns
    -------
    One mask (h, w) bool per view.
    """
    import cv2

    side, lines = _thin_side(density), []
    for view, foot in zip(views, feet, strict=True):
        is_thin = _find_thin_cells(view, side).is_thin
        _, numbers, boxes, _ = cv2.connectedComponentsWithStats(is_thin.astype(np.uint8), connectivity=8)
        lies = np.zeros(is_thin.shape, bool)
        for number, (left, top, wide, high, _) in enumerate(boxes[1:].tolist(), 1):
            box = slice(top, top + high), slice(left, left + wide)
            cells = is_thin[box] & (numbers[box] == number)
            if _lies_on_ground(cells, foot / side - (left, top), side / density):
                lies[box] |= cells
        lines.append(squares_to_texels(lies, side, view.seen.shape))
    rim = AGREEMENT.thin_rim_cells * side
    return [
        line & ~np.any([one.clear & ~grow_mask(lines[j], rim) for j, one in enumerate(views) if j != i], axis=0)
        for i, line in enumerate(lines)
    ]


def _lies_on_ground(cells: BoolArray, foot: Float64Array, cell_m: float) -> bool:
    """Return True for cells (r, c) along a line that does not point at a place, in cells."""
    row, column = np.nonzero(cells)
    offsets = np.column_stack([column, row]) + 0.5 - foot
    middle = offsets.mean(axis=0)
    if len(row) * cell_m < AGREEMENT.min_line_m:  # too few for any line
        return False
    (xx, xy), (_, yy) = np.cov((offsets - middle).T)
    turn = 0.5 * np.arctan2(2 * xy, xx - yy)
    along = np.array([np.cos(turn), np.sin(turn)])
    across = np.array([along[1], -along[0]])
    length = (np.ptp(offsets @ along) + 1) * cell_m
    # a bent line spreads over more than its width
    spread = (np.ptp(offsets @ across) + 1) * cell_m
    return bool(
        length >= max(AGREEMENT.min_line_m, AGREEMENT.min_line_widths * spread)
        and abs(middle @ across) * cell_m >= AGREEMENT.min_line_distance_m
    )


class _ThinCells(NamedTuple):
    """Cells (r, c) of a view: logarithm of their colour (r, c, 3), which are usable, which contrast with their surroundings."""

    log_colour: Float32Array
    is_usable: BoolArray
    is_thin: BoolArray


def _thin_side(density: float) -> int:
    return max(1, round(AGREEMENT.thin_cell_m * density))


def _find_thin_cells(view: ChartView, side: int) -> _ThinCells:
    import cv2

    window = 2 * round(AGREEMENT.median_window_m / AGREEMENT.thin_cell_m / 2) + 1
    log_colour, share = mean_log_colour(view.rgb, view.clear, side)
    is_usable = share > AGREEMENT.min_clear_share
    colour = np.rint(fill_unknown_values(np.exp(log_colour), is_usable)).clip(1, 255).astype(np.uint8)
    median_colour = np.log(np.maximum(cv2.medianBlur(colour, window), 1).astype(np.float32))
    is_thin = is_usable & (np.abs(log_colour - median_colour).max(axis=2) > AGREEMENT.min_thin_contrast)
    return _ThinCells(log_colour, is_usable, is_thin)


def grow_mask(mask: BoolArray, by: int) -> BoolArray:
    """Return the mask (h, w) with `by` elements around it."""
    import cv2

    grown: BoolArray = cv2.dilate(mask.astype(np.uint8), np.ones((2 * by + 1,) * 2, np.uint8)) > 0
    return grown


def squares_to_texels(squares: BoolArray, side: int, shape: tuple[int, ...]) -> BoolArray:
    """Repeat squares (r, c) of `side` texels to a raster of the given shape (h, w)."""
    return squares.repeat(side, axis=0).repeat(side, axis=1)[: shape[0], : shape[1]]


def _bounding_box(mask: BoolArray, margin: int) -> tuple[slice, slice]:
    """Return the rows and columns of a mask (r, c) that hold all that is set, with a margin; none if nothing is."""
    if not mask.any():
        return slice(0), slice(0)
    row, column = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    return (
        slice(max(0, int(row[0]) - margin), int(row[-1]) + margin + 1),
        slice(max(0, int(column[0]) - margin), int(column[-1]) + margin + 1),
    )


def _has_match(log_colour: Float32Array, other: Float32Array, is_usable: BoolArray, reach: int = 1) -> BoolArray:
    """Find squares (r, c) whose colour the other view shows within `reach` squares."""
    is_matched = np.zeros(is_usable.shape, bool)
    rows, columns = is_usable.shape
    padded = np.pad(other, ((reach, reach), (reach, reach), (0, 0)))
    usable_padded = np.pad(is_usable, reach)
    for down in range(2 * reach + 1):
        for right in range(2 * reach + 1):
            window = (slice(down, down + rows), slice(right, right + columns))
            is_matched |= usable_padded[window] & (
                np.abs(log_colour - padded[window]).max(axis=2) <= AGREEMENT.max_log_difference
            )
    return is_matched


def mean_log_colour(rgb: UInt8Array, mask: BoolArray, side: int) -> tuple[Float32Array, Float32Array]:
    """Compute the logarithm of the mean colour of each square's texels in a mask.

    Parameters
    ----------
    rgb : (h, w, 3) uint8.
    mask : (h, w) bool.
    side : side of a square in texels.

    Returns
    -------
    Logarithm (r, c, 3), and the share (r, c) of the square that is in the mask.
    """
    share = square_means(mask.astype(np.float32), side)
    total = square_means(rgb * mask[..., None].astype(np.float32), side)
    return np.log(np.maximum(total / np.maximum(share, 1e-6)[..., None], 1.0)), share
