"""Fusion of several views of a chart into one raster, with matched exposures and hidden seams.

The choice of a view per cell minimises, by alpha-expansion (Boykov, Veksler & Zabih 2001), the loss of quality and the
colour difference along seams (Kwatra et al. 2003). The gains follow Brown & Lowe 2007, with a median as each pair's
ratio.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from facade_core.core.arrays import (
    AnyArray,
    BoolArray,
    Float32Array,
    Float64Array,
    FloatArray,
    IntArray,
    NumericArray,
    UInt8Array,
)
from facade_core.core.errors import ImageError
from facade_core.core.fixed_order import solve_least_squares

# Cells along the longer side of the raster; seams run between cells.
CELLS = 160
# Cost of a cell that its view does not show,
UNSEEN_COST = 50.0
# and of a cell with an occluder.
OCCLUDED_COST = 5.0
# Cost of a colour that differs from the median of three or more views by the full range: content of a single
# view is an occluder.
OUTLIER_COST = 4.0
# Cost of a seam between two neighbours,
SEAM_COST = 0.02
# and of a full colour difference along it. A loss of quality costs up to 1.
SEAM_DIFFERENCE_COST = 6.0
# Sweeps over all views before the labelling is accepted as it is.
MAX_SWEEPS = 4
# Gains beyond these mean that two pictures do not show the same thing.
GAIN_RANGE = (0.5, 2.0)
# Cells of overlap that an exposure ratio needs,
MIN_OVERLAP_CELLS = 12
# with colours in this range.
EXPOSED_RANGE = (8.0, 247.0)
# Texels on each side of a seam over which views are blended.
FADE_TEXELS = 4
# Colour difference from which views are not blended.
GHOST_DIFFERENCE = 48.0


@dataclass(frozen=True, slots=True, eq=False)
class ChartView:
    """Chart as one picture shows it.

    Attributes
    ----------
    rgb : (h, w, 3) uint8.
    seen : (h, w) bool.
    quality : (h, w) float32, 0 to 1: share of the raster's resolution times the sine of the viewing angle.
    occluded : (h, w) bool or None, an object that the mesh lacks is in front of the wall.
    """

    rgb: UInt8Array
    seen: BoolArray
    quality: Float32Array
    occluded: BoolArray | None = None

    def __post_init__(self) -> None:
        shape = self.seen.shape
        if self.rgb.shape != (*shape, 3) or self.rgb.dtype != np.uint8 or 0 in shape:
            raise ImageError(f"a view's rgb is uint8 {(*shape, 3)}, not {self.rgb.dtype} {self.rgb.shape}; resample it")
        for name in ("quality", "occluded"):
            array = getattr(self, name)
            if array is not None and array.shape != shape:
                raise ImageError(f"a view's {name} is {array.shape} where seen is {shape}; resample it")

    @property
    def clear(self) -> BoolArray:
        """Return the texels (h, w) bool that are seen and not occluded."""
        return self.seen if self.occluded is None else self.seen & ~self.occluded


@dataclass(frozen=True, slots=True, eq=False)
class FusedView:
    """Raster fused from several views.

    Attributes
    ----------
    rgb : (h, w, 3) uint8, black where not seen.
    seen : (h, w) bool, by any view.
    source : (h, w) int8 view of each texel, -1 without.
    confidence : (h, w) float32 quality, 0 where not seen or occluded.
    occluded : (h, w) bool, seen but occluded in every view.
    """

    rgb: UInt8Array
    seen: BoolArray
    source: AnyArray
    confidence: Float32Array
    occluded: BoolArray


def as_chart_view(fused: FusedView) -> ChartView:
    """Convert a fused view to a chart view."""
    return ChartView(fused.rgb, fused.seen, fused.confidence, fused.occluded)


def fuse_views(views: Sequence[ChartView], *, exposures_match: bool = False) -> FusedView:
    """Fuse one to 127 views of one chart; the view of highest total quality sets the exposure.

    Parameters
    ----------
    views : views of equal size.
    exposures_match : views have one exposure already.

    Raises
    ------
    ImageError
        If there are no views, too many, or views of different sizes.
    """
    if not 1 <= len(views) <= 127:
        raise ImageError(f"{len(views)} views of a chart; give 1 to 127")
    if len({view.seen.shape for view in views}) > 1:
        raise ImageError("views of a chart differ in size; rectify them to one")
    seen, clear = np.stack([view.seen for view in views]), np.stack([view.clear for view in views])
    quality = np.stack([np.where(view.seen, view.quality, 0).astype(np.float32) for view in views])
    if len(views) == 1:
        rgb = np.where(seen[0, ..., None], views[0].rgb, 0).astype(np.uint8)
        return FusedView(rgb, seen[0], seen[0].astype(np.int8) - 1, quality[0] * clear[0], seen[0] & ~clear[0])
    cell = max(1, -(-max(seen.shape[1:]) // CELLS))
    basis = np.stack([_colour_texels(view, cell) for view in views])
    share_seen, share_clear, share = (
        np.stack([square_means(m, cell) for m in masks]) for masks in (seen, clear, basis)
    )
    colour = np.stack([square_means(v.rgb * m[..., None], cell) for v, m in zip(views, basis, strict=True)])
    colour /= np.maximum(share, 1e-6)[..., None]
    gain = (
        np.ones((len(views), 3))
        if exposures_match
        else _exposure_gains(colour, share_clear > 0.5, quality.sum(axis=(1, 2)))
    )
    even = np.clip(colour * gain[:, None, None], 0, 255) / 255
    unary = _unary_costs(even, share_seen, share_clear, np.stack([square_means(q, cell) for q in quality]))
    label = _alpha_expansion(unary, _fill_unseen(even, share_seen)).repeat(cell, axis=0).repeat(cell, axis=1)
    return _compose(views, gain, seen, clear, quality, label[: seen.shape[1], : seen.shape[2]])


def square_means(array: NumericArray | BoolArray, cell: int) -> Float32Array:
    """Return means over squares of `cell` texels of an array (h, w) or (h, w, 3), float32, padded with 0."""
    import cv2

    rows, columns = (-(-n // cell) for n in array.shape[:2])
    padding = (0, rows * cell - array.shape[0], 0, columns * cell - array.shape[1])
    whole = cv2.copyMakeBorder(array.astype(np.float32), *padding, cv2.BORDER_CONSTANT, value=(0, 0, 0))
    return np.asarray(cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA), np.float32)


def _colour_texels(view: ChartView, cell: int) -> BoolArray:
    """Texels (h, w) bool that define a view's colour of a cell: the clear ones, or all seen ones in a cell without."""
    if view.occluded is None:
        return view.seen
    has_clear = (square_means(view.clear, cell) > 0).repeat(cell, axis=0).repeat(cell, axis=1)
    return np.where(has_clear[: view.seen.shape[0], : view.seen.shape[1]], view.clear, view.seen)


def _exposure_gains(colour: Float32Array, clear: BoolArray, quality: Float32Array) -> Float64Array:
    """Factors (n, 3) that bring the cells' colours (n, r, c, 3) to the exposure of the view of highest quality (n,)."""
    n = len(colour)
    exposed = clear & ((colour >= EXPOSED_RANGE[0]) & (colour <= EXPOSED_RANGE[1])).all(axis=3)
    equations, ratios, weights = [], [], []
    for i, j in combinations(range(n), 2):
        shared = exposed[i] & exposed[j]
        if shared.sum() < MIN_OVERLAP_CELLS:
            continue
        equations.append(np.eye(n)[i] - np.eye(n)[j])
        ratios.append(np.median(np.log(colour[j][shared] / colour[i][shared]), axis=0))
        weights.append(np.sqrt(shared.sum()))
    if not equations:
        return np.ones((n, 3))
    # a weak pull towards a gain of one fixes views that share nothing with the rest
    weight = np.array([*weights, *np.full(n, 1e-3)])[:, None]
    matrix, right = np.vstack([*equations, np.eye(n)]), np.vstack([*ratios, np.zeros((n, 3))])
    solution = solve_least_squares(weight * matrix, weight * right)
    reference = int(quality.argmax())
    is_reachable = _reachable_views(np.array(equations) != 0, reference)
    gain = np.exp(solution - np.where(is_reachable[:, None], solution[reference], 0))
    gains: Float64Array = np.clip(gain, *GAIN_RANGE)
    return gains


def _reachable_views(pairs: BoolArray, start: int) -> BoolArray:
    """Return the views (n,) bool that pairs (k, n) bool connect to a start view, directly or through others."""
    reached: BoolArray = np.arange(pairs.shape[1]) == start
    for _ in range(pairs.shape[1]):
        reached = reached | pairs[(pairs & reached).any(axis=1)].any(axis=0)
    return reached


def _unary_costs(colour: FloatArray, seen: Float32Array, clear: Float32Array, quality: Float32Array) -> FloatArray:
    """Cost of each view in each cell: (n, r, c)."""
    loss = quality.max(axis=0) - quality
    outlier = np.zeros_like(loss)
    if len(colour) > 2:
        clear_colour = np.where((clear > 0.5)[..., None], colour, np.nan)
        enough = (clear > 0.5).sum(axis=0) > 2
        outlier[:, enough] = np.abs(clear_colour[:, enough] - np.nanmedian(clear_colour[:, enough], axis=0)).mean(
            axis=2
        )
    visibility_cost = (1 - seen) * UNSEEN_COST + (seen - clear) * OCCLUDED_COST
    costs: FloatArray = loss + OUTLIER_COST * np.nan_to_num(outlier) + visibility_cost - visibility_cost.min(axis=0)
    return costs


def _fill_unseen(colour: FloatArray, seen: Float32Array) -> FloatArray:
    """Return the colours of the cells, with unseen ones copied from the views that see them.

    A seam at a view's border costs nothing.
    """
    is_seen = (seen > 0).astype(np.float32)[..., None]
    others = (colour * is_seen).sum(axis=0) / np.maximum(is_seen.sum(axis=0), 1)
    return np.where(is_seen > 0, colour, others)


def _alpha_expansion(unary: FloatArray, colour: FloatArray) -> IntArray:
    """Labels (r, c) int8 of low unary cost (n, r, c) and colour difference (n, r, c, 3) along seams."""
    label: IntArray = unary.argmin(axis=0).astype(np.int8)
    best = _energy(unary, colour, label)
    for _ in range(MAX_SWEEPS):
        previous = best
        for view in range(len(unary)):
            moved = np.where(_expansion_move(unary, colour, label, view), np.int8(view), label)
            energy = _energy(unary, colour, moved)
            if energy < best:
                label, best = moved, energy
        if best == previous:
            break
    return label


def _expansion_move(unary: FloatArray, colour: FloatArray, label: IntArray, view: int) -> BoolArray:
    """Cells (r, c) bool that change to a view in its best expansion move."""
    import maxflow

    if (label == view).all():
        return np.zeros(label.shape, bool)
    turned = np.full_like(label, view)
    stay, turn = _select_label(unary, label), unary[view].astype(np.float64)
    graph = maxflow.GraphFloat(label.size, 2 * label.size)
    nodes = graph.add_grid_nodes(label.shape)
    for axis, structure in ((1, [[0, 0, 0], [0, 0, 1], [0, 0, 0]]), (0, [[0, 0, 0], [0, 0, 0], [0, 1, 0]])):
        both = _seam_costs(colour, label, label, axis)
        first, second = _seam_costs(colour, turned, label, axis), _seam_costs(colour, label, turned, axis)
        # E = both + (first - both) x_p - first x_q + (first + second - both) (1 - x_p) x_q (Kolmogorov & Zabih 2004)
        near, far = _neighbour_slices(axis)
        turn[near] += first - both
        turn[far] -= first
        weight = np.zeros(label.shape)
        weight[near] = np.maximum(first + second - both, 0)
        graph.add_grid_edges(nodes, weight, np.array(structure), symmetric=False)
    low = np.minimum(stay, turn)
    graph.add_grid_tedges(nodes, turn - low, stay - low)
    graph.maxflow()
    is_moved: BoolArray = graph.get_grid_segments(nodes)
    return is_moved


def _neighbour_slices(axis: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Slices of both ends of all neighbour pairs along an axis."""
    first, second, whole = slice(None, -1), slice(1, None), slice(None)
    return ((first, whole), (second, whole)) if axis == 0 else ((whole, first), (whole, second))


def _select_label(values: FloatArray, label: IntArray) -> Float64Array:
    """Values (n, r, c, ...) of the labels (r, c): (r, c, ...) float64."""
    return values[label, np.arange(label.shape[0])[:, None], np.arange(label.shape[1])].astype(np.float64)


def _seam_costs(colour: FloatArray, label: IntArray, other: IntArray, axis: int) -> Float64Array:
    """Costs of neighbours along an axis, the first labelled by `label`, the second by `other`."""
    near, far = _neighbour_slices(axis)
    a, b = label[near], other[far]
    at_near, at_far = colour[(slice(None), *near)], colour[(slice(None), *far)]
    difference = sum(np.abs(_select_label(c, a) - _select_label(c, b)).mean(axis=2) for c in (at_near, at_far))
    costs: Float64Array = (a != b) * (SEAM_COST + SEAM_DIFFERENCE_COST / 2 * difference)
    return costs


def _energy(unary: FloatArray, colour: FloatArray, label: IntArray) -> float:
    return float(
        _select_label(unary, label).sum() + sum(_seam_costs(colour, label, label, axis).sum() for axis in (0, 1))
    )


def _compose(
    views: Sequence[ChartView],
    gain: Float64Array,
    seen: BoolArray,
    clear: BoolArray,
    quality: Float32Array,
    label: IntArray,
) -> FusedView:
    """Raster from labels per texel (h, w); another view replaces a label that does not show the wall."""
    import cv2

    rank = quality + clear + seen
    usable = np.take_along_axis(clear, label[None].astype(np.intp), axis=0)[0]
    source = np.where(usable, label, rank.argmax(axis=0)).astype(np.int8)
    any_seen, any_clear = np.asarray(seen.any(axis=0)), np.asarray(clear.any(axis=0))
    source[~any_seen] = -1
    rgb = np.zeros((*label.shape, 3), np.uint8)
    shares = []
    for number, view in enumerate(views):
        is_own = source == number
        rgb[is_own] = np.round(np.minimum(view.rgb[is_own] * gain[number], 255))
        shares.append(cv2.blur(is_own.astype(np.float32), (2 * FADE_TEXELS + 1,) * 2, borderType=cv2.BORDER_REPLICATE))
    share = np.stack(shares)
    near_seam = (share.max(axis=0) < 1 - 1e-6) & any_clear
    total, weight = np.zeros((near_seam.sum(), 3), np.float32), np.zeros((near_seam.sum(), 1), np.float32)
    for number, view in enumerate(views):
        colour = np.minimum(view.rgb[near_seam] * gain[number].astype(np.float32), 255)
        # blend similar colours only: no ghosts of objects near the seam
        agreeing = np.clip(1 - np.abs(colour - rgb[near_seam]).mean(axis=1) / GHOST_DIFFERENCE, 0, 1)
        faded = (share[number][near_seam] * agreeing * clear[number][near_seam])[:, None]
        total, weight = total + faded * colour, weight + faded
    rgb[near_seam] = np.where(weight > 0, np.round(total / np.maximum(weight, 1e-6)), rgb[near_seam])
    confidence = np.take_along_axis(quality, np.maximum(source, 0)[None].astype(np.intp), axis=0)[0] * any_clear
    return FusedView(rgb, any_seen, source, confidence, any_seen & ~any_clear)
