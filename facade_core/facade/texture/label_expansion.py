"""Choose one source for each hidden pixel: minimise prices and visible seams by graph cuts."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, Int64Array
from facade_core.core.numba_cache import njit
from facade_core.facade.texture.settings import INPAINTING
from facade_core.facade.texture.source_costs import UNUSABLE_PRICE, SourceCosts


def choose_sources(costs: SourceCosts, edges: Int64Array, rim_prices: Float32Array, seam_price: float) -> Int64Array:
    """Choose the source of every pixel by alpha expansion; non-submodular moves are truncated.

    Parameters
    ----------
    costs : price and colour of n pixels under k translations.
    edges : (e, 2) int64 pairs of neighbouring pixels.
    rim_prices : (k, n) float32 price of seams to known pixels.
    seam_price : price of a seam for each unit of colour difference of its two pictures at both pixels.

    Returns
    -------
    (n,) int64 index of the translation.

    References
    ----------
    Konushin & Vezhnevets 2007 (floors paper), section 3.2.2.
    """
    unary = costs.price + rim_prices
    labels: Int64Array = unary.argmin(0)
    for _ in range(INPAINTING.expansion_sweeps):
        changed = False
        for alpha in np.argsort(-np.bincount(labels, minlength=len(unary)), kind="stable"):
            changed |= _expand_label(int(alpha), labels, unary, costs.colour, edges, seam_price)
        if not changed:
            break
    return labels


def _expand_label(
    alpha: int, labels: Int64Array, unary: Float32Array, colour: Float32Array, edges: Int64Array, seam: float
) -> bool:
    """Let pixels switch to alpha where that lowers the energy; return whether any did."""
    import maxflow

    loose = (labels != alpha) & (unary[alpha] < UNUSABLE_PRICE)
    if not loose.any():
        return False
    number = np.cumsum(loose) - 1
    count = int(loose.sum())
    own = np.stack([unary[labels, np.arange(len(labels))], unary[alpha]], 1)[loose].astype(np.float64)
    first, second, forth = _edge_capacities(alpha, labels, loose, number, colour, edges, seam, own)
    graph = maxflow.GraphFloat(count, len(first))
    graph.add_nodes(count)
    if len(first):
        graph.add_edges(first, second, forth, np.zeros_like(forth))
    graph.add_grid_tedges(np.arange(count), own[:, 1], own[:, 0])
    graph.maxflow()
    # A pixel on the sink's side pays its source capacity, the price of alpha.
    switched = np.flatnonzero(loose)[graph.get_grid_segments(np.arange(count))]
    labels[switched] = alpha
    return bool(len(switched))


@njit(cache=True)
def _seam_difference(colour: Float32Array, a: int, b: int, p: int, q: int) -> float:
    if a == b:
        return 0.0
    total = 0.0
    for c in range(3):
        total += abs(colour[a, p, c] - colour[b, p, c]) + abs(colour[a, q, c] - colour[b, q, c])
    return total


@njit(cache=True)
def _edge_capacities(
    alpha: int,
    labels: Int64Array,
    loose: BoolArray,
    number: Int64Array,
    colour: Float32Array,
    edges: Int64Array,
    seam: float,
    unary: Float64Array,
) -> tuple[Int64Array, Int64Array, Float64Array]:
    """Return the edges among loose pixels; add the cost of edges to fixed pixels to `unary`."""
    first, second = np.empty(len(edges), np.int64), np.empty(len(edges), np.int64)
    forth = np.empty(len(edges), np.float64)
    count = 0
    for e in range(len(edges)):
        p, q = edges[e, 0], edges[e, 1]
        if not loose[p] and not loose[q]:
            continue
        stay = seam * _seam_difference(colour, labels[p], labels[q], p, q)
        if not loose[q]:
            unary[number[p], 0] += stay
            unary[number[p], 1] += seam * _seam_difference(colour, alpha, labels[q], p, q)
        elif not loose[p]:
            unary[number[q], 0] += stay
            unary[number[q], 1] += seam * _seam_difference(colour, labels[p], alpha, p, q)
        else:
            only_q = seam * _seam_difference(colour, labels[p], alpha, p, q)  # q switches, p stays
            only_p = seam * _seam_difference(colour, alpha, labels[q], p, q)
            stay = min(stay, only_p + only_q)
            unary[number[p], 0] += stay
            unary[number[p], 1] += only_p
            unary[number[q], 1] -= only_p
            first[count], second[count], forth[count] = number[p], number[q], only_p + only_q - stay
            count += 1
    for n in range(len(unary)):
        low = min(unary[n, 0], unary[n, 1])
        unary[n, 0] -= low
        unary[n, 1] -= low
    return first[:count], second[:count], forth[:count]
