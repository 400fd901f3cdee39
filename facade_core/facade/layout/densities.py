"""Densities of the ten scores: Gaussian mixtures with a number of components chosen by BIC, and small tables.

A mixture is a (COMPONENT_COUNT, 5) float64 array: weight, mean and standard deviation of the value, then mean and
deviation of the condition (zero without one). Unused components have weight zero.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.core.numba_cache import njit
from facade_core.facade.layout.statistics import LABEL_COUNT

COMPONENT_COUNT = 4
# Lower bound of log-densities: a term can speak against a layout, not forbid it (Eq. 8 is ln 0 for a single type).
MIN_LOG_DENSITY = float(np.log(1e-3))
_LOG_TWO_PI = float(np.log(2 * np.pi))

# Weighted terms: aspect ratio, spacing, regularity, completeness; patterns, alignment; compatibility, coverage, border,
# symmetry.
TERMS = ("as", "ed", "gr", "completeness", "gp", "ga", "ec", "coverage", "fb", "fs")

# Rows of Densities.mixtures after one aspect ratio per label.
(
    WIDTH_RATIO_ROW,
    HEIGHT_RATIO_ROW,
    REGULAR_X_ROW,
    REGULAR_Y_ROW,
    COMPLETENESS_ROW,
    ALIGN_X_ROW,
    ALIGN_Y_ROW,
    COVERAGE_ROW,
    SIDE_BORDER_ROW,
    TOP_BORDER_ROW,
    BOTTOM_BORDER_ROW,
) = range(LABEL_COUNT, LABEL_COUNT + 11)
MIXTURE_COUNT = LABEL_COUNT + 11
# Bins of the symmetric share.
SYMMETRY_BINS = 10
# Bins of the door position; the first one is "no door".
DOOR_BINS = 6


class ScoreTermDensities(NamedTuple):
    """Learned densities of the score terms.

    Attributes
    ----------
    mixtures : (MIXTURE_COUNT, COMPONENT_COUNT, 5) Gaussian mixtures.
    patterns : (PATTERNS,) log-probabilities of interleaving patterns.
    symmetry : (DOOR_BINS, SYMMETRY_BINS) log-probabilities of the symmetric share by door position.
    compatibility : (2**ELEMENT_TYPE_COUNT,) log-probability of each set of element types.
    """

    mixtures: Float64Array
    patterns: Float64Array
    symmetry: Float64Array
    compatibility: Float64Array


@njit(cache=True)
def log_density(value: float, mixture: Float64Array) -> float:
    """Return ln p(value), at least MIN_LOG_DENSITY."""
    total = 0.0
    for k in range(COMPONENT_COUNT):
        if mixture[k, 0] > 0:
            z = (value - mixture[k, 1]) / mixture[k, 2]
            total += mixture[k, 0] * np.exp(-0.5 * (z * z + _LOG_TWO_PI)) / mixture[k, 2]
    return max(MIN_LOG_DENSITY, np.log(total)) if total > 0 else MIN_LOG_DENSITY


@njit(cache=True)
def log_conditional_density(value: float, condition: float, mixture: Float64Array) -> float:
    """Return ln p(value | condition), at least MIN_LOG_DENSITY."""
    joint, marginal = 0.0, 0.0
    for k in range(COMPONENT_COUNT):
        if mixture[k, 0] > 0:
            c = (condition - mixture[k, 3]) / mixture[k, 4]
            share = mixture[k, 0] * np.exp(-0.5 * c * c) / mixture[k, 4]
            z = (value - mixture[k, 1]) / mixture[k, 2]
            marginal += share
            joint += share * np.exp(-0.5 * (z * z + _LOG_TWO_PI)) / mixture[k, 2]
    return max(MIN_LOG_DENSITY, np.log(joint / marginal)) if joint > 0 else MIN_LOG_DENSITY
