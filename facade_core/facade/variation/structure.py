"""Hierarchy of structure matrices: the MRF of AlSisan & Mitra 2012, Eq. 1, solved by ICM."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import Float64Array, Int32Array
from facade_core.core.ties import first_minimum
from facade_core.facade.variation.icm import initial_icm_state, run_icm

# Range and growth of the weight alpha; costs are normalised to [0, 1], regularity is not.
_ALPHA_RANGE = (1e-3, 1e3)
_ALPHA_GROWTH = 2.6


@dataclass(frozen=True, slots=True, eq=False)
class RegularitySolution:
    """Relabelled structure matrix for one weight of regularity, with its energies.

    Attributes
    ----------
    alpha : weight of regularity.
    labels : (R, C) int32 as S0.
    energies : Eq. 1 at the start and after every accepted move.
    """

    alpha: float
    labels: Int32Array
    energies: Float64Array


def regularise_structure_matrix(structure: Int32Array, cost: Float64Array) -> list[RegularitySolution]:
    """Relabel a structure matrix with growing weight of regularity until one label remains.

    Each weight starts from the previous solution, which is also the reference of its data term. If ICM stops earlier,
    the last solution has the single type that is cheapest for all cells.

    Parameters
    ----------
    structure : (R, C) int32 element types, -1 for an empty cell.
    cost : (T, T) cost of relabelling a as b.

    Returns
    -------
    One solution for each weight.
    """
    current = np.ascontiguousarray(structure, np.int32)
    cost = np.ascontiguousarray(cost, np.float64)
    found: list[RegularitySolution] = []
    moves = initial_icm_state(current, len(cost))
    alpha = _ALPHA_RANGE[0]
    while _count_types(current) > 1 and alpha <= _ALPHA_RANGE[1]:
        energies = run_icm(moves, cost, alpha)
        current = moves.labels
        found.append(RegularitySolution(alpha, current, energies))
        alpha *= _ALPHA_GROWTH
    if _count_types(current) > 1:
        used = current[current >= 0]
        present = np.unique(used)
        cheapest = present[first_minimum(cost[np.ix_(used, present)].sum(axis=0))]
        found.append(
            RegularitySolution(np.inf, np.where(current >= 0, cheapest, current).astype(np.int32), np.zeros(0))
        )
    return found


def _count_types(labels: Int32Array) -> int:
    return len(np.unique(labels[labels >= 0]))
