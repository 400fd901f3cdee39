"""Ten scores of a layout and their weighted sum, the logarithm of Eq. 15 without Z (Fan et al. 2014, section 4)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.core.arrays import Float64Array, Int64Array
from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.core.numba_cache import njit
from facade_core.core.types import Element
from facade_core.facade.layout import statistics as st
from facade_core.facade.layout.densities import (
    ALIGN_X_ROW,
    ALIGN_Y_ROW,
    BOTTOM_BORDER_ROW,
    COMPLETENESS_ROW,
    COVERAGE_ROW,
    DOOR_BINS,
    HEIGHT_RATIO_ROW,
    MIN_LOG_DENSITY,
    REGULAR_X_ROW,
    REGULAR_Y_ROW,
    SIDE_BORDER_ROW,
    SYMMETRY_BINS,
    TOP_BORDER_ROW,
    WIDTH_RATIO_ROW,
    log_conditional_density,
    log_density,
)
from facade_core.facade.layout.grids import box_array, fit_grids
from facade_core.facade.layout.model import LayoutModel, default_layout_model
from facade_core.facade.layout.statistics import measure_layout
from facade_core.facade.layout.validation import check_domain, check_elements


def score(
    elements: Sequence[Element], domain: tuple[float, float, float, float], *, model: LayoutModel | None = None
) -> float:
    """Return ln p(G|w) without Z: the weighted sum of the ten terms, higher is more plausible.

    The result does not depend on the order of the elements. Every log-density is at least ln 1e-3.

    Parameters
    ----------
    elements : windows, balconies, doors and shops; other labels do not count, exact duplicates count once.
    domain : (x0, y0, x1, y1) of the facade in the unit of the elements, y down.
    model : the shipped layout model by default.

    Raises
    ------
    LayoutError
        For elements or a domain that cannot be used.

    References
    ----------
    Fan et al. 2014, Eq. 15.
    """
    check_domain(domain)
    check_elements(elements, domain)
    chosen = model or default_layout_model()
    return float((chosen.weights * layout_score_terms(elements, domain, chosen)).sum())


def layout_score_terms(
    elements: Sequence[Element], domain: tuple[float, float, float, float], model: LayoutModel
) -> Float64Array:
    """Return the (10,) values of TERMS, summed or averaged over grids as the model demands."""
    total, count = sum_log_densities(*measure_layout_from_elements(elements, domain), *model.densities)
    terms: Float64Array = total / np.maximum(count, 1) if model.averages_terms else total
    return terms


def measure_layout_from_elements(
    elements: Sequence[Element], domain: tuple[float, float, float, float]
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Measure a layout's statistics with elements in a fixed order, so that sums do not depend on the input order.

    Returns
    -------
    As `measure_layout`.
    """
    kept = sorted({e for e in elements if e.label in ELEMENT_CLASSES}, key=lambda e: (e.label, e.y0, e.x0, e.y1, e.x1))
    box, label, grid = box_label_grid_arrays(kept)
    measures: tuple[Float64Array, Float64Array, Float64Array] = measure_layout(
        box, label, grid, np.array(domain, float)
    )
    return measures


def box_label_grid_arrays(elements: Sequence[Element]) -> tuple[Float64Array, Int64Array, Int64Array]:
    """Return boxes, labels and grids of elements as the arrays of compiled functions.

    Returns
    -------
    box (N, 4), label (N,) and grid (N,).
    """
    label = np.array([ELEMENT_CLASSES.index(e.label) for e in elements], np.int64)
    grid = np.zeros(len(elements), np.int64)
    for g, fitted in enumerate(fit_grids(elements)):
        grid[fitted.cells[fitted.cells >= 0]] = g
    return box_array(elements), label, grid


@njit(cache=True)
def sum_log_densities(
    unary: Float64Array,
    pairs: Float64Array,
    overall: Float64Array,
    mixtures: Float64Array,
    patterns: Float64Array,
    symmetry: Float64Array,
    compatibility: Float64Array,
) -> tuple[Float64Array, Float64Array]:
    """Sum the log-densities of each term over a layout's grids and pairs of grids.

    Parameters
    ----------
    unary, pairs, overall : statistics of `measure_layout`.
    mixtures, patterns, symmetry, compatibility : arrays of `Densities`.

    Returns
    -------
    (10,) sums in the order of TERMS, and (10,) number of summands.
    """
    total, count = np.zeros(10), np.zeros(10)
    for g in range(len(unary)):
        u = unary[g]
        total[0] += log_density(u[st.ASPECT], mixtures[int(u[st.LABEL])])
        count[0] += 1
        for column, row, term in (
            (st.WIDTH_RATIO, WIDTH_RATIO_ROW, 1),
            (st.HEIGHT_RATIO, HEIGHT_RATIO_ROW, 1),
            (st.REGULAR_X, REGULAR_X_ROW, 2),
            (st.REGULAR_Y, REGULAR_Y_ROW, 2),
            (st.COMPLETE, COMPLETENESS_ROW, 3),
        ):
            if not np.isnan(u[column]):
                total[term] += log_density(u[column], mixtures[row])
                count[term] += 1
    for k in range(len(pairs)):
        p = pairs[k]
        if not np.isnan(p[st.PATTERN]):
            total[4] += patterns[int(p[st.PATTERN])]
            count[4] += 1
        if not np.isnan(p[st.ALIGN_X]):
            total[5] += log_conditional_density(p[st.ALIGN_X], p[st.GAP_X], mixtures[ALIGN_X_ROW])
            count[5] += 1
        if not np.isnan(p[st.ALIGN_Y]):
            total[5] += log_conditional_density(p[st.ALIGN_Y], p[st.GAP_Y], mixtures[ALIGN_Y_ROW])
            count[5] += 1
    total[6] = compatibility[int(overall[st.TYPES])]
    total[7] = log_density(overall[st.COVERAGE], mixtures[COVERAGE_ROW])
    if np.isnan(overall[st.SYMMETRY]):
        total[8], total[9] = 4 * MIN_LOG_DENSITY, MIN_LOG_DENSITY
    else:
        total[8] += log_density(overall[st.BORDER_LEFT], mixtures[SIDE_BORDER_ROW])
        total[8] += log_density(overall[st.BORDER_RIGHT], mixtures[SIDE_BORDER_ROW])
        total[8] += log_density(overall[st.BORDER_TOP], mixtures[TOP_BORDER_ROW])
        total[8] += log_density(overall[st.BORDER_BOTTOM], mixtures[BOTTOM_BORDER_ROW])
        door = door_bin(overall[st.DOOR_AT])
        total[9] = symmetry[door, min(SYMMETRY_BINS - 1, int(overall[st.SYMMETRY] * SYMMETRY_BINS))]
    count[6], count[7], count[8], count[9] = 1, 1, 4, 1
    return total, count


@njit(cache=True)
def door_bin(at: float) -> int:
    """Return the row of the symmetry table: 0 without a door, else by the mean door position from left to right."""
    return 0 if at == 0 else 1 + min(DOOR_BINS - 2, int(at * (DOOR_BINS - 1)))
