"""Features of pairs of windows of one size group: differences of their appearance and agreement of their states."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import Float64Array, Int32Array
from facade_core.core.fixed_order import multiply_matrices
from facade_core.facade.variation.element_types import mean_silhouette
from facade_core.facade.variation.window_features import FEATURE_BLOCKS

# Least spread of a feature in a group, in standard deviations of all windows.
_MIN_SPREAD = 0.15
# Unit of distances of descriptors.
_DESCRIPTOR_UNIT = 50.0
# Largest distance in medians of the group's; where most windows are the same picture the median is 0.
_MAX_RELATIVE = 100.0
# Range of the probability of one state, for its log odds.
_MIN_PROBABILITY = 1e-3
# Context of groups of fewer than three windows.
_DEFAULT_CONTEXT = (0.5, 0.2)


class GroupAppearance(NamedTuple):
    """Appearance of the windows of one size group.

    Attributes
    ----------
    features : (N, d) absolute features in standard deviations of all windows.
    states : (N, S) probabilities of states.
    descriptors : (N, c) of `compute_descriptors`.
    appearance_types : (N,) int32 types by the descriptors alone.
    """

    features: Float64Array
    states: Float64Array
    descriptors: Float64Array
    appearance_types: Int32Array


def iterate_pair_features(group: GroupAppearance) -> Iterator[Float64Array]:
    """Yield the (N, N) symmetric features of all pairs of a group, one after the other."""
    from scipy.spatial.distance import cdist

    spread = group.features / (group.features.std(axis=0) + _MIN_SPREAD)
    for scaled in (group.features, spread):
        first = 0
        for size in FEATURE_BLOCKS:
            block = scaled[:, first : first + size]
            yield cdist(block, block, "cityblock") / size
            first += size
    apart = cdist(group.descriptors, group.descriptors)
    yield apart / _DESCRIPTOR_UNIT
    yield np.minimum(apart / max(_median_of_pairs(apart), 1e-6), _MAX_RELATIVE)
    yield _agreement(group.appearance_types)
    same = np.clip(multiply_matrices(group.states, group.states.T), _MIN_PROBABILITY, 1 - _MIN_PROBABILITY)
    yield np.log(same / (1 - same))
    yield same
    yield _agreement(group.states.argmax(axis=1).astype(np.int32))
    for state in group.states.T:
        yield np.minimum(state[:, None], state[None])


def group_context(group: GroupAppearance) -> Float64Array:
    """Return a leading 1, and how well descriptors repeat and separate: on clean pictures they count more than states.

    Returns
    -------
    (3,): 1, median distance to the nearest window relative to the median distance, silhouette of the types.
    """
    from scipy.spatial.distance import cdist

    if len(group.descriptors) < 3:
        return np.array([1.0, *_DEFAULT_CONTEXT])
    apart = cdist(group.descriptors, group.descriptors)
    median = _median_of_pairs(apart)
    np.fill_diagonal(apart, np.inf)
    nearest = float(np.median(apart.min(axis=1)))
    points = np.ascontiguousarray(group.descriptors, np.float64)
    return np.array(
        [
            1.0,
            nearest / max(median, 1e-6),
            max(0.0, mean_silhouette(points, np.ascontiguousarray(group.appearance_types))),
        ]
    )


def _median_of_pairs(apart: Float64Array) -> float:
    pairs = apart[np.triu_indices(len(apart), 1)]
    return float(np.median(pairs)) if len(pairs) else 0.0


def _agreement(types: Int32Array) -> Float64Array:
    same: Float64Array = (types[:, None] == types[None]).astype(np.float64)
    return same
