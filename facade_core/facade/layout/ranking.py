"""Probability of a proposed element: gradient-boosted trees over its features."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, Int64Array
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


def train_trees(
    rows: Float32Array, truth: BoolArray, *, seed: int, rounds: int = 400, leaves: int = 32
) -> BoostedTrees:
    """Boost trees on features with known truth, in one thread so that results do not depend on the machine.

    Parameters
    ----------
    rows : (N, features) float32.
    truth : (N,) bool.
    seed : seed of the learner.
    rounds : number of trees.
    leaves : largest number of leaves of a tree.
    """
    from sklearn.ensemble import HistGradientBoostingClassifier
    from threadpoolctl import threadpool_limits

    learner = HistGradientBoostingClassifier(
        max_iter=rounds,
        learning_rate=0.05,
        max_leaf_nodes=leaves,
        min_samples_leaf=60,
        l2_regularization=3.0,
        max_features=0.3,
        early_stopping=False,
        random_state=seed,
    )
    with threadpool_limits(1):
        learner.fit(rows, truth)
    roots, parts, offset = [], [], 0
    for (tree,) in learner._predictors:  # sklearn has no public access to its trees  # noqa: SLF001
        nodes = tree.nodes
        leaf = nodes["is_leaf"].astype(bool)
        roots.append(offset)
        parts.append(
            (
                np.where(leaf, -1, nodes["feature_idx"]),
                np.where(leaf, 0, nodes["num_threshold"]),
                np.where(leaf, 0, nodes["left"] + offset),
                np.where(leaf, 0, nodes["right"] + offset),
                np.where(leaf, nodes["value"], 0),
            )
        )
        offset += len(nodes)
    feature, threshold, left, right, value = (np.concatenate(part) for part in zip(*parts, strict=True))
    return BoostedTrees(
        np.array(roots, np.int64),
        feature.astype(np.int64),
        threshold.astype(np.float32),
        left.astype(np.int64),
        right.astype(np.int64),
        np.round(value, 5),
        float(np.round(learner._baseline_prediction.item(), 5)),  # noqa: SLF001
    )
