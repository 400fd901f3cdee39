"""Completing a partly seen facade layout by extending the grids of what is seen."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product, starmap

import numpy as np

from facade_core.errors import LayoutError, ModelError
from facade_core.labels import ELEMENT_CLASSES
from facade_core.layout.extension import Extension, extend
from facade_core.layout.grids import boxes, check, grids
from facade_core.types import Completion, Element

Box = tuple[float, float, float, float]


def complete(
    observed: Sequence[Element],
    domain: Box,
    observed_region: Sequence[Box],
    *,
    n: int = 1,
    seed: int = 0,
    model: object | None = None,
) -> list[Completion]:
    """Propose up to n distinct whole layouts of a partly seen facade, best first (the task of Fan et al. 2014).

    observed: the elements seen, wholly or in part; domain: (x0, y0, x1, y1) of the facade; observed_region: boxes of
    the part that is seen; all in one unit, y down. Every completion starts with the observed elements, unchanged and
    in their order (exact duplicates once), then the proposals: inside the domain, clear of the observed region, of the
    observed elements and of each other; only a window and a balcony may overlap, as they do where they are seen.

    Method: the grids of the observed elements (`grids`) are extended at their spacings and their empty cells filled
    with the size of their row and column; balconies follow their windows, doors stay on the ground line. Labels other
    than window, balcony, door and shop are kept and not extended. Alternatives leave out the border row or column,
    mirror the seen half about the facade's middle, or let a grid keep its own phase instead of the facade's margins.

    Score, in [-1, 2]: the grids' mean completeness, less the spread of their spacings (standard deviation over mean),
    less the imbalance of the left and right margin (share of the width), plus the share of the domain's
    height and width that the elements span. A measure of regularity, not a probability.

    The result has no random choice, so `seed` changes nothing. One element or a lone column: the spacing is unknown
    and only the mirror image is proposed. No element in a seen region: a bare wall, returned as such. Raises
    LayoutError for an element without area, of an unknown label, centred outside the domain or outside the observed
    region, for a box without area or outside the domain, and when neither an element nor a region is given; ModelError
    when a model is given.
    """
    if model is not None:
        raise ModelError("layout.complete: extends grids without a model; pass model=None")
    if n < 1:
        raise LayoutError(f"layout.complete: n must be at least 1, not {n}")
    seen = list(dict.fromkeys(observed))
    check(seen)
    region = _checked_region(seen, domain, observed_region)
    if not seen:
        return [Completion((), 0.0)]
    found: dict[frozenset[tuple[object, ...]], Completion] = {}
    fitted = grids(seen)
    for how in starmap(Extension, product((False, True), (True, False), (False, True), (False, True))):
        layout = tuple(seen) + tuple(_clear(extend(seen, fitted, domain, how), seen, domain, region))
        # Ways that differ by rounding only, or by order, are one alternative.
        scale = 1e-6 * (domain[2] - domain[0])
        key = frozenset((e.label, *(round(v / scale) for v in (e.x0, e.y0, e.x1, e.y1))) for e in layout)
        if key not in found:
            found[key] = Completion(layout, regularity(layout, domain))
    return sorted(found.values(), key=lambda completion: -completion.score)[:n]


def regularity(elements: Sequence[Element], domain: Box) -> float:
    """The score that `complete` documents; independent of the elements' order."""
    things = [e for e in elements if e.label in ELEMENT_CLASSES]
    if not things:
        return 0.0
    fitted = grids(things)
    weight = np.array([(g.cells >= 0).sum() for g in fitted], float)
    completeness = np.array([g.completeness for g in fitted])
    spread = np.array([_spread(g.row_spacing) + _spread(g.column_spacing) for g in fitted])
    box = boxes(things)
    low, high = box[:, :2].min(axis=0), box[:, 2:].max(axis=0)
    x0, y0, x1, y1 = domain
    imbalance = abs((low[0] - x0) - (x1 - high[0])) / (x1 - x0)
    span = np.clip((high - low) / (x1 - x0, y1 - y0), 0, 1).mean()
    return float(np.clip((completeness - spread) @ weight / weight.sum(), -1, 1) - imbalance + span)


def _spread(spacing: np.ndarray) -> float:
    return float(spacing.std() / spacing.mean()) if len(spacing) else 0.0


def _checked_region(seen: Sequence[Element], domain: Box, observed_region: Sequence[Box]) -> np.ndarray:
    x0, y0, x1, y1 = domain
    if not (np.isfinite(domain).all() and x0 < x1 and y0 < y1):
        raise LayoutError(f"domain {tuple(domain)}: give finite x0 < x1 and y0 < y1")
    region = np.array([tuple(b) for b in observed_region], float).reshape(-1, 4)
    for i, (a0, b0, a1, b1) in enumerate(region.tolist()):
        if not (a0 < a1 and b0 < b1 and a0 < x1 and a1 > x0 and b0 < y1 and b1 > y0):
            raise LayoutError(f"observed region {i}: needs an area inside the domain, not {(a0, b0, a1, b1)}")
    if not len(region):
        raise LayoutError("observed region: empty, so nothing was seen; give the boxes that are visible")
    box = boxes(seen)
    centre = (box[:, :2] + box[:, 2:]) / 2
    outside = ~((centre >= (x0, y0)) & (centre <= (x1, y1))).all(axis=1)
    for i in np.flatnonzero(outside).tolist():
        raise LayoutError(f"element {i} ({seen[i].label}): centred outside the domain {tuple(domain)}; drop or move it")
    for i in np.flatnonzero(~_overlap(box, region).any(axis=1)).tolist():
        raise LayoutError(f"element {i} ({seen[i].label}): outside the observed region; extend the region or drop it")
    return region


def _overlap(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(N, M) bool: the open rectangles (N, 4) and (M, 4) share area."""
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum(a[:, None, 2:], b[None, :, 2:])
    return (low < high).all(axis=2)


def _clear(proposals: Iterable[Element], seen: Sequence[Element], domain: Box, region: np.ndarray) -> list[Element]:
    """The proposals, earlier ones first served, that lie in the domain and overlap nothing they must not."""
    kept: list[Element] = []
    x0, y0, x1, y1 = domain
    for e in proposals:
        if e.x0 < x0 or e.y0 < y0 or e.x1 > x1 or e.y1 > y1 or _overlap(boxes([e]), region).any():
            continue
        others = [o for o in (*seen, *kept) if {o.label, e.label} != {"window", "balcony"}]
        if not others or not _overlap(boxes([e]), boxes(others)).any():
            kept.append(e)
    return kept
