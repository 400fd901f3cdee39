"""Structure matrices and their hierarchy: the MRF of AlSisan & Mitra 2012, Eq. 1, solved by ICM."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facade_core.facade.variation.icm import FIXED_POINT_ONE, initial_icm_state, run_icm, sum_reciprocal_sizes

# The weight alpha grows by _GROWTH from _ALPHA[0] to _ALPHA[1]; costs are normalised to [0, 1], regularity is not.
_ALPHA_RANGE = (1e-3, 1e3)
_ALPHA_GROWTH = 2.6


@dataclass(frozen=True, slots=True, eq=False)
class Relaxation:
    """One weight's solution: labels like S0, and Eq. 1 after every accepted move, the start first."""

    alpha: float
    labels: np.ndarray
    energies: np.ndarray


def relax_structure(structure: np.ndarray, cost: np.ndarray) -> list[Relaxation]:
    """Relabel a structure matrix with growing weight of regularity until one label remains.

    structure (R, C) int32: element types, -1 where the grid has no element; cost (T, T): of relabelling a as b.
    Each weight starts from the previous solution, which is also what its data term compares with. Returns a solution
    per weight; the last one has a single label: the type that is cheapest for all, should ICM have stopped before.
    """
    current = np.ascontiguousarray(structure, np.int32)
    cost = np.ascontiguousarray(cost, np.float64)
    found: list[Relaxation] = []
    moves = initial_icm_state(current, len(cost))
    alpha = _ALPHA_RANGE[0]
    while _count_types(current) > 1 and alpha <= _ALPHA_RANGE[1]:
        energies = run_icm(moves, cost, alpha)
        current = moves.labels
        found.append(Relaxation(alpha, current, energies))
        alpha *= _ALPHA_GROWTH
    if _count_types(current) > 1:
        used = current[current >= 0]
        present = np.unique(used)
        cheapest = present[np.argmin(cost[np.ix_(used, present)].sum(axis=0))]
        found.append(Relaxation(np.inf, np.where(current >= 0, cheapest, current).astype(np.int32), np.zeros(0)))
    return found


def regularity_terms(structure: np.ndarray) -> tuple[float, float, float]:
    """The three terms of E_reg: number of types, sum of reciprocal repeats, sum of reciprocal sub-rectangle sizes."""
    labels = np.ascontiguousarray(structure, np.int32)
    counts = np.unique(labels[labels >= 0], return_counts=True)
    sizes = sum(sum_reciprocal_sizes(labels == label) for label in counts[0])
    return float(len(counts[0])), float((1 / counts[1]).sum()), sizes / FIXED_POINT_ONE


def _count_types(labels: np.ndarray) -> int:
    return len(np.unique(labels[labels >= 0]))
