"""One raster of a chart from several views of it: each part from the best, exposures matched, seams where they show least.

The choice per cell minimises, by alpha-expansion (Boykov, Veksler & Zabih 2001), what is lost in quality and the colour
difference along the seams (Kwatra et al. 2003); the gains are those of Brown & Lowe 2007, each pair's ratio a median.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from facade_core.core.errors import ImageError

# Cells along the longer side of the raster: seams run between cells.
CELLS = 160
# Costs of a cell that its view does not show, and of one whose view shows something before the wall.
UNSEEN, OCCLUDED = 50.0, 5.0
# Cost of a colour off the median of three or more views by the full range: what one view alone shows stands before the wall.
ODD = 4.0
# Cost of a seam between two neighbours, and of their full colour difference along it; quality lost costs up to 1.
SEAM, DIFFERENCE = 0.02, 6.0
# Sweeps over all views after which the labelling is taken as it is.
SWEEPS = 4
# Gains beyond these say that two pictures do not show the same thing.
GAIN = (0.5, 2.0)
# Cells below which an overlap says nothing of the exposure; nor do colours outside this range.
LEAST_OVERLAP = 12
EXPOSED = (8.0, 247.0)
# Texels to either side of a seam over which one view fades into the next.
FADE = 4
# Colour difference from which a view does not fade into another.
GHOST = 48.0


@dataclass(frozen=True, slots=True, eq=False)
class ChartView:
    """A chart as one picture shows it: rgb (h, w, 3) uint8; seen (h, w) bool; quality (h, w) float32, from 0 to 1, the share of
    the raster's resolution that the picture has, times the sine of the angle at which it looks at the surface; occluded
    (h, w) bool or None, where something that is not in the mesh stands before the wall."""

    rgb: np.ndarray
    seen: np.ndarray
    quality: np.ndarray
    occluded: np.ndarray | None = None

    def __post_init__(self) -> None:
        shape = self.seen.shape
        if self.rgb.shape != (*shape, 3) or self.rgb.dtype != np.uint8 or 0 in shape:
            raise ImageError(f"a view's rgb is uint8 {(*shape, 3)}, not {self.rgb.dtype} {self.rgb.shape}; resample it")
        for name in ("quality", "occluded"):
            array = getattr(self, name)
            if array is not None and array.shape != shape:
                raise ImageError(f"a view's {name} is {array.shape} where seen is {shape}; resample it")

    @property
    def clear(self) -> np.ndarray:
        """Where the view shows the wall itself: (h, w) bool."""
        return self.seen if self.occluded is None else self.seen & ~self.occluded


@dataclass(frozen=True, slots=True, eq=False)
class FusedView:
    """rgb (h, w, 3) uint8, black where not seen; seen (h, w) bool, by any view; source (h, w) int8, the view that a texel is
    from, -1 without; confidence (h, w) float32, the quality there, 0 where not seen or occluded; occluded (h, w) bool, seen
    but with something before it in every view."""

    rgb: np.ndarray
    seen: np.ndarray
    source: np.ndarray
    confidence: np.ndarray
    occluded: np.ndarray


def as_chart_view(fused: FusedView) -> ChartView:
    """What was made of several views, as one."""
    return ChartView(fused.rgb, fused.seen, fused.confidence, fused.occluded)


def fuse_views(views: Sequence[ChartView], *, matched: bool = False) -> FusedView:
    """One raster from one to 127 views of one chart; the exposure is that of the view with the most quality in sum.

    matched: whether they are of one exposure already.

    Raises ImageError without views or for views of different sizes.
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
    basis = np.stack([_basis(view, cell) for view in views])
    share_seen, share_clear, share = (np.stack([_mean(m, cell) for m in masks]) for masks in (seen, clear, basis))
    colour = np.stack([_mean(v.rgb * m[..., None], cell) for v, m in zip(views, basis, strict=True)])
    colour /= np.maximum(share, 1e-6)[..., None]
    gain = np.ones((len(views), 3)) if matched else _gains(colour, share_clear > 0.5, quality.sum(axis=(1, 2)))
    colour = np.clip(colour * gain[:, None, None], 0, 255) / 255
    unary = _unary(colour, share_seen, share_clear, np.stack([_mean(q, cell) for q in quality]))
    label = _expand(unary, _completed(colour, share_seen)).repeat(cell, axis=0).repeat(cell, axis=1)
    return _compose(views, gain, seen, clear, quality, label[: seen.shape[1], : seen.shape[2]])


def _mean(array: np.ndarray, cell: int) -> np.ndarray:
    """Means over cells of `cell` texels a side of an array (h, w) or (h, w, 3), float32; beyond the border lies 0."""
    import cv2

    rows, columns = (-(-n // cell) for n in array.shape[:2])
    padding = (0, rows * cell - array.shape[0], 0, columns * cell - array.shape[1])
    whole = cv2.copyMakeBorder(array.astype(np.float32), *padding, cv2.BORDER_CONSTANT, value=(0, 0, 0))
    return cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA)


def _basis(view: ChartView, cell: int) -> np.ndarray:
    """The texels (h, w) bool that make up a view's colour of their cell: the clear ones, or all seen in a cell without."""
    if view.occluded is None:
        return view.seen
    some = (_mean(view.clear, cell) > 0).repeat(cell, axis=0).repeat(cell, axis=1)
    return np.where(some[: view.seen.shape[0], : view.seen.shape[1]], view.clear, view.seen)


def _gains(colour: np.ndarray, clear: np.ndarray, quality: np.ndarray) -> np.ndarray:
    """Factors (n, 3) that bring the cells' colours (n, r, c, 3) to one exposure, that of the view of most quality (n,)."""
    n = len(colour)
    exposed = clear & ((colour >= EXPOSED[0]) & (colour <= EXPOSED[1])).all(axis=3)
    equations, ratios, weights = [], [], []
    for i, j in combinations(range(n), 2):
        shared = exposed[i] & exposed[j]
        if shared.sum() < LEAST_OVERLAP:
            continue
        equations.append(np.eye(n)[i] - np.eye(n)[j])
        ratios.append(np.median(np.log(colour[j][shared] / colour[i][shared]), axis=0))
        weights.append(np.sqrt(shared.sum()))
    if not equations:
        return np.ones((n, 3))
    # a faint pull to no gain at all settles the views that share nothing with the rest
    weight = np.array([*weights, *np.full(n, 1e-3)])[:, None]
    matrix, right = np.vstack([*equations, np.eye(n)]), np.vstack([*ratios, np.zeros((n, 3))])
    solution = np.linalg.lstsq(weight * matrix, weight * right, rcond=None)[0]
    reference = int(quality.argmax())
    joined = _joined(np.array(equations) != 0, reference)
    gain = np.exp(solution - np.where(joined[:, None], solution[reference], 0))
    return np.clip(gain, *GAIN)


def _joined(pairs: np.ndarray, start: int) -> np.ndarray:
    """The views (n,) bool that pairs (k, n) bool join to a first one, directly or through others."""
    reached = np.arange(pairs.shape[1]) == start
    for _ in range(pairs.shape[1]):
        reached = reached | pairs[(pairs & reached).any(axis=1)].any(axis=0)
    return reached


def _unary(colour: np.ndarray, seen: np.ndarray, clear: np.ndarray, quality: np.ndarray) -> np.ndarray:
    """What each view costs in each cell: (n, r, c)."""
    loss = quality.max(axis=0) - quality
    odd = np.zeros_like(loss)
    if len(colour) > 2:
        shown = np.where((clear > 0.5)[..., None], colour, np.nan)
        enough = (clear > 0.5).sum(axis=0) > 2
        odd[:, enough] = np.abs(shown[:, enough] - np.nanmedian(shown[:, enough], axis=0)).mean(axis=2)
    shut = (1 - seen) * UNSEEN + (seen - clear) * OCCLUDED
    return loss + ODD * np.nan_to_num(odd) + shut - shut.min(axis=0)


def _completed(colour: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """The cells' colours, those that a view does not show taken from the views that do: a seam at its border costs nothing."""
    shown = (seen > 0).astype(np.float32)[..., None]
    others = (colour * shown).sum(axis=0) / np.maximum(shown.sum(axis=0), 1)
    return np.where(shown > 0, colour, others)


def _expand(unary: np.ndarray, colour: np.ndarray) -> np.ndarray:
    """The labelling (r, c) int8 of least unary cost (n, r, c) and colour difference (n, r, c, 3) along seams."""
    label = unary.argmin(axis=0).astype(np.int8)
    best = _energy(unary, colour, label)
    for _ in range(SWEEPS):
        before = best
        for view in range(len(unary)):
            moved = np.where(_move(unary, colour, label, view), np.int8(view), label)
            energy = _energy(unary, colour, moved)
            if energy < best:
                label, best = moved, energy
        if best == before:
            break
    return label


def _move(unary: np.ndarray, colour: np.ndarray, label: np.ndarray, view: int) -> np.ndarray:
    """The cells (r, c) bool that turn to a view in the best expansion of it."""
    import maxflow

    if (label == view).all():
        return np.zeros(label.shape, bool)
    turned = np.full_like(label, view)
    stay, turn = _chosen(unary, label), unary[view].astype(np.float64)
    graph = maxflow.GraphFloat(label.size, 2 * label.size)
    nodes = graph.add_grid_nodes(label.shape)
    for axis, structure in ((1, [[0, 0, 0], [0, 0, 1], [0, 0, 0]]), (0, [[0, 0, 0], [0, 0, 0], [0, 1, 0]])):
        both = _seams(colour, label, label, axis)
        first, second = _seams(colour, turned, label, axis), _seams(colour, label, turned, axis)
        # E = both + (first - both) x_p - first x_q + (first + second - both) (1 - x_p) x_q (Kolmogorov & Zabih 2004)
        near, far = _sides(axis)
        turn[near] += first - both
        turn[far] -= first
        weight = np.zeros(label.shape)
        weight[near] = np.maximum(first + second - both, 0)
        graph.add_grid_edges(nodes, weight, np.array(structure), symmetric=False)
    low = np.minimum(stay, turn)
    graph.add_grid_tedges(nodes, turn - low, stay - low)
    graph.maxflow()
    return graph.get_grid_segments(nodes)


def _sides(axis: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Both ends of all pairs of neighbours along an axis."""
    first, second, whole = slice(None, -1), slice(1, None), slice(None)
    return ((first, whole), (second, whole)) if axis == 0 else ((whole, first), (whole, second))


def _chosen(values: np.ndarray, label: np.ndarray) -> np.ndarray:
    """Of values (n, r, c, ...) those of the views chosen (r, c): (r, c, ...) float64."""
    return values[label, np.arange(label.shape[0])[:, None], np.arange(label.shape[1])].astype(np.float64)


def _seams(colour: np.ndarray, label: np.ndarray, other: np.ndarray, axis: int) -> np.ndarray:
    """What neighbours along an axis cost where the first is labelled by `label` and the second by `other`."""
    near, far = _sides(axis)
    a, b = label[near], other[far]
    at_near, at_far = colour[(slice(None), *near)], colour[(slice(None), *far)]
    difference = sum(np.abs(_chosen(c, a) - _chosen(c, b)).mean(axis=2) for c in (at_near, at_far))
    return (a != b) * (SEAM + DIFFERENCE / 2 * difference)


def _energy(unary: np.ndarray, colour: np.ndarray, label: np.ndarray) -> float:
    return float(_chosen(unary, label).sum() + sum(_seams(colour, label, label, axis).sum() for axis in (0, 1)))


def _compose(
    views: Sequence[ChartView], gain: np.ndarray, seen: np.ndarray, clear: np.ndarray, quality: np.ndarray, label: np.ndarray
) -> FusedView:
    """The raster from a choice of views per texel (h, w), which gives way where the chosen one does not show the wall."""
    import cv2

    rank = quality + clear + seen
    usable = np.take_along_axis(clear, label[None].astype(np.intp), axis=0)[0]
    source = np.where(usable, label, rank.argmax(axis=0)).astype(np.int8)
    any_seen, any_clear = np.asarray(seen.any(axis=0)), np.asarray(clear.any(axis=0))
    source[~any_seen] = -1
    rgb = np.zeros((*label.shape, 3), np.uint8)
    shares = []
    for number, view in enumerate(views):
        own = source == number
        rgb[own] = np.round(np.minimum(view.rgb[own] * gain[number], 255))
        shares.append(cv2.blur(own.astype(np.float32), (2 * FADE + 1,) * 2, borderType=cv2.BORDER_REPLICATE))
    share = np.stack(shares)
    near = (share.max(axis=0) < 1 - 1e-6) & any_clear
    total, weight = np.zeros((near.sum(), 3), np.float32), np.zeros((near.sum(), 1), np.float32)
    for number, view in enumerate(views):
        colour = np.minimum(view.rgb[near] * gain[number].astype(np.float32), 255)
        # a view fades in only as far as it shows the same: no ghosts of what stands beside the seam
        agreeing = np.clip(1 - np.abs(colour - rgb[near]).mean(axis=1) / GHOST, 0, 1)
        faded = (share[number][near] * agreeing * clear[number][near])[:, None]
        total, weight = total + faded * colour, weight + faded
    rgb[near] = np.where(weight > 0, np.round(total / np.maximum(weight, 1e-6)), rgb[near])
    confidence = np.take_along_axis(quality, np.maximum(source, 0)[None].astype(np.intp), axis=0)[0] * any_clear
    return FusedView(rgb, any_seen, source, confidence, any_seen & ~any_clear)
