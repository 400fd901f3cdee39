"""Types of windows by a metric that is learnt from windows whose states were marked by eye."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import Float64Array, Int32Array
from facade_core.core.fixed_order import multiply_matrices
from facade_core.core.json_model import read_json_model
from facade_core.facade.variation.element_types import (
    choose_representatives,
    cluster_types,
    compute_descriptors,
    order_by_frequency,
)
from facade_core.facade.variation.group_patches import GroupPatches
from facade_core.facade.variation.window_features import FEATURE_BLOCKS, FEATURES_VERSION, compute_window_features
from facade_core.facade.variation.window_pairs import GroupAppearance, group_context, iterate_pair_features

SHIPPED_WINDOW_METRIC = Path(__file__).parent / "models" / "window_types.json"
# States of a window, in the order of the model's outputs.
WINDOW_STATES = ("glass", "cloth", "half", "closed", "open")
# A larger logit is certain.
_MAX_LOGIT = 50.0
MADE_FOR = {"features": FEATURES_VERSION, "states": list(WINDOW_STATES)}
_REMEDY = "fetch it again or run `streetloom train windows`"
# Two clusters are of one type if their windows are alike with at least this mean probability.
_MIN_SIMILARITY = 0.5
# Types by appearance alone hold where their mean silhouette is at least this, as where pictures repeat exactly; of the photos
# that trained the metric none reaches .75.
_CLEAR_SILHOUETTE = 0.8
# Decimals of probabilities.
_DECIMALS = 10


class WindowMetric(NamedTuple):
    """Two logistic regressions: of the state of a window, and of whether two windows are of one type.

    Attributes
    ----------
    mean, scale : (d,) of the features of windows.
    state_weights : (d + 1, states), the last row is the bias.
    pair_weights : (3, pairs' features) for each value of `group_context`.
    pair_bias : (3,) the same.
    """

    mean: Float64Array
    scale: Float64Array
    state_weights: Float64Array
    pair_weights: Float64Array
    pair_bias: Float64Array

    def predict_states(self, features: Float64Array) -> Float64Array:
        """Return the (N, states) probabilities of features (N, d)."""
        logits = multiply_matrices((features - self.mean) / self.scale, self.state_weights[:-1])
        logits += self.state_weights[-1]
        shares = np.exp(logits - logits.max(axis=1, keepdims=True))
        return _round_off(shares / shares.sum(axis=1, keepdims=True))

    def predict_similarity(self, group: GroupAppearance, context: Float64Array) -> Float64Array:
        """Return the (N, N) probability that two windows of a group with its `group_context` are of one type."""
        weights = multiply_matrices(context, self.pair_weights)
        logits = np.full((len(group.features),) * 2, float((context * self.pair_bias).sum()))
        for weight, feature in zip(weights, iterate_pair_features(group), strict=True):
            logits += weight * feature
        return _round_off(1 / (1 + np.exp(-np.clip(logits, -_MAX_LOGIT, _MAX_LOGIT))))


def describe_group(group: GroupPatches, features: Float64Array, scale: Float64Array) -> GroupAppearance:
    """Return the appearance of a group's windows, with unknown states.

    Parameters
    ----------
    group : patches of windows of one size.
    features : (N, d) of `compute_window_features`.
    scale : (d,) standard deviations of the features.
    """
    absolute = sum(FEATURE_BLOCKS)
    descriptors = compute_descriptors(group.patches, group.seen)
    return GroupAppearance(
        features[:, :absolute] / scale[:absolute],
        np.zeros((len(features), len(WINDOW_STATES))),
        descriptors,
        cluster_types(descriptors)[0],
    )


def compare_windows(group: GroupPatches) -> tuple[Float64Array, GroupAppearance, Float64Array]:
    """Return the (N, N) probability that two windows are of one type, the group's appearance and its context."""
    metric = shipped_window_metric()
    features = compute_window_features(group.patches, group.wall)
    appearance = describe_group(group, features, metric.scale)._replace(states=metric.predict_states(features))
    context = group_context(appearance)
    return metric.predict_similarity(appearance, context), appearance, context


def cluster_window_types(group: GroupPatches) -> tuple[Int32Array, Int32Array]:
    """Cluster windows by average linkage of the probability that two are of one type.

    Windows whose appearance alone separates them clearly keep the types that it gives.

    Returns
    -------
    (N,) int32 types, the most frequent first, and (T,) int32 representatives.
    """
    similarity, appearance, context = compare_windows(group)
    clear = context[2] >= _CLEAR_SILHOUETTE
    types = order_by_frequency(appearance.appearance_types if clear else _link(similarity))
    return types, choose_representatives(appearance.descriptors, types)


def _round_off(probabilities: Float64Array) -> Float64Array:
    """Round to _DECIMALS: numpy's exponential differs between processors in its last bit."""
    rounded: Float64Array = np.round(probabilities, _DECIMALS)
    return rounded


def _link(similarity: Float64Array) -> Int32Array:
    if len(similarity) < 2:
        return np.zeros(len(similarity), np.int32)
    from scipy.cluster.hierarchy import fcluster, linkage

    apart = 1 - similarity[np.triu_indices(len(similarity), 1)]
    return np.asarray(fcluster(linkage(apart, "average"), 1 - _MIN_SIMILARITY, "distance"), np.int32)


@lru_cache(maxsize=1)
def shipped_window_metric() -> WindowMetric:
    """Return the metric of windows that this package ships."""
    return load_window_metric(SHIPPED_WINDOW_METRIC)


def load_window_metric(path: Path) -> WindowMetric:
    """Read a metric of windows.

    Raises
    ------
    ModelError
        The file is missing or invalid, its checksum differs, or another version wrote it.
    """
    record = read_json_model(path, "metric of windows", MADE_FOR, _REMEDY)
    return WindowMetric(*(np.array(record["model"][field], float) for field in WindowMetric._fields))
