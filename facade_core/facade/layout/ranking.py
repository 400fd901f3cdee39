"""Probability of a proposed element: gradient-boosted trees over its features."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import Float32Array, Float64Array, Int64Array
from facade_core.core.numba_cache import njit


class BoostedTrees(NamedTuple):
    """Boosted regression trees as flat arrays over M nodes.

    Attributes
    ----------
    roots : (T,) index of each tree's first node.
    feature : (M,) feature index, -1 at a leaf.
    threshold : (M,) a value that is not above it goes left.
    left, right : (M,) index of the children.
    value : (M,) value of a leaf.
    base : start of the sum.
    """

    roots: Int64Array
    feature: Int64Array
    threshold: Float32Array
    left: Int64Array
    right: Int64Array
    value: Float64Array
    base: float


@njit(cache=True)
def predict_probability(trees: BoostedTrees, rows: Float32Array) -> Float64Array:
    """Return the (N,) probabilities that proposals with these features are correct.

    Parameters
    ----------
    rows : (N, features) float32.
    """
    out = np.empty(len(rows))
    for i in range(len(rows)):
        total = trees.base
        for root in trees.roots:
            node = root
            while trees.feature[node] >= 0:
                above = rows[i, trees.feature[node]] > trees.threshold[node]
                node = trees.right[node] if above else trees.left[node]
            total += trees.value[node]
        out[i] = 1 / (1 + np.exp(-total))
    return out
