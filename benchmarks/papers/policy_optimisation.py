"""Policy optimisation by a genetic algorithm (Fan et al. 2014, section 5.2).

The functions that generate and score a candidate are compiled. The loop over candidates is not: it would compile
all its callees a second time, for seconds, to save a tenth of a second in a run.
"""

# ruff: noqa: NPY002  (compiled code has its own copy of the legacy generator, seeded at each roll-out)

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.papers.placement import ObservedLayoutArrays, mark_elements_beside_gaps, next_element_distances
from benchmarks.papers.policy import (
    COPY_SPACING,
    DATABASE_LABEL,
    OBSERVED_LABEL,
    OBSERVED_SPACING,
    roll_out_policy,
)
from facade_core.core.arrays import Float64Array, Int64Array
from facade_core.core.numba_cache import njit
from facade_core.core.types import Element
from facade_core.facade.layout.facade_frame import Rectangle, fit_columns_and_floors
from facade_core.facade.layout.model import POLICY_LENGTH, LayoutModel
from facade_core.facade.layout.scores import box_label_grid_arrays, sum_log_densities
from facade_core.facade.layout.statistics import measure_layout

POLICY_POPULATION = 10
_MUTATION_DEVIATION = 0.15


def observed_layout_arrays(
    seen: Sequence[Element], domain: Rectangle, region: Float64Array, model: LayoutModel
) -> ObservedLayoutArrays:
    """Return the observed layout in the form that the policy needs.

    Parameters
    ----------
    seen : observed elements.
    domain : (x0, y0, x1, y1) of the facade.
    region : (M, 4) visible boxes.
    """
    box, label, grid = box_label_grid_arrays(seen)
    facade = fit_columns_and_floors(seen, domain)
    sizes = (
        np.array([(1.0, 1.0), (1.3, 0.5), model.priors.door_sizes[0, :2], model.priors.shop_sizes[0, :2]]) * facade.size
    )
    return ObservedLayoutArrays(
        np.ascontiguousarray(box),
        label,
        grid,
        next_element_distances(np.ascontiguousarray(box), grid),
        mark_elements_beside_gaps(np.ascontiguousarray(box), grid),
        int(grid.max()) + 1 if len(grid) else 0,
        np.array(domain, float),
        np.ascontiguousarray(region),
        sizes,
        model.priors.size_to_spacing,
        model.label_shares,
        float(facade.ground),
    )


def evolve_policy_candidates(
    policies: Float64Array,
    start: ObservedLayoutArrays,
    model: LayoutModel,
    generations: int,
    tries: int,
    seed: int,
) -> tuple[Float64Array, Int64Array, Float64Array]:
    """Evolve policies for one facade and return every candidate that they completed.

    The value of a policy is the best score among its `tries` completions.

    Parameters
    ----------
    policies : (POLICY_POPULATION, POLICY_LENGTH) initial policies.
    model : its densities and weights score the candidates.

    Returns
    -------
    For each of C = generations * POLICY_POPULATION * tries candidates its policy (C, POLICY_LENGTH), the seed (C,)
    that reproduces it by `roll_out_policy`, and its score (C,).

    References
    ----------
    Fan et al. 2014, Eq. 24.
    """
    size = len(policies)
    count = generations * size * tries
    used, seeds, scores = np.empty((count, POLICY_LENGTH)), np.empty(count, np.int64), np.empty(count)
    population, value = policies.copy(), np.full(size, -np.inf)
    k = 0
    for generation in range(generations):
        children = population.copy() if generation == 0 else _breed_policies(population, value, seed + generation)
        fitness = np.full(size, -np.inf)
        for p in range(size):
            for _ in range(tries):
                seeds[k] = seed * 1_000_003 % 2_147_000_000 + k
                box, label, grid = roll_out_policy(children[p], start, int(seeds[k]))
                scores[k] = score_candidate_layout(box, label, grid, start.domain, model)
                used[k] = children[p]
                fitness[p] = max(fitness[p], scores[k])
                k += 1
        if generation == 0:
            value = fitness
            continue
        for p in range(size):  # the best of parents and children survive
            worst = np.argmin(value)
            if fitness[p] > value[worst]:
                value[worst], population[worst] = fitness[p], children[p]
    return used, seeds, scores


def score_candidate_layout(
    box: Float64Array,
    label: Int64Array,
    grid: Int64Array,
    domain: Float64Array,
    model: LayoutModel,
) -> float:
    """Return the score of a candidate layout on the grids that the policy kept.

    Parameters
    ----------
    box : (N, 4) x0, y0, x1, y1.
    label : (N,) index into ELEMENT_CLASSES.
    grid : (N,) grid index of each element.
    domain : (4,) x0, y0, x1, y1 of the facade.
    model : densities and weights of the terms.
    """
    densities = model.densities
    unary, pairs, overall = measure_layout(box, label, grid, domain)
    total, count = sum_log_densities(
        unary, pairs, overall, densities.mixtures, densities.patterns, densities.symmetry, densities.compatibility
    )
    value = 0.0
    for weight, score, times in zip(model.weights.tolist(), total.tolist(), count.tolist(), strict=True):
        value += weight * (score / max(times, 1.0) if model.averages_terms else score)
    return value


@njit()
def _breed_policies(population: Float64Array, value: Float64Array, seed: int) -> Float64Array:
    """Cross pairs of tournament winners parameter by parameter, and mutate one parameter of each child."""
    np.random.seed(seed)
    size = len(population)
    out = np.empty_like(population)
    for p in range(size):
        parents = np.empty(2, np.int64)
        for k in range(2):
            a, b = np.random.randint(size), np.random.randint(size)
            parents[k] = a if value[a] >= value[b] else b
        j = 0
        while j < POLICY_LENGTH:
            parent = population[parents[np.random.randint(2)]]
            if j == 3:  # the priority of directions is one parameter
                for k in range(3, 8):
                    out[p, k] = parent[k]
                j = 8
            else:
                out[p, j] = parent[j]
                j += 1
        changed = np.random.randint(11)
        if changed == 3:
            a, b = 3 + np.random.randint(5), 3 + np.random.randint(5)
            out[p, a], out[p, b] = out[p, b], out[p, a]
        else:
            j = changed if changed < 3 else changed + 4
            out[p, j] = min(1.0, max(0.0, out[p, j] + _MUTATION_DEVIATION * np.random.standard_normal()))
        project_to_simplex(out[p])
    return out


@njit()
def project_to_simplex(policy: Float64Array) -> None:
    """Scale probabilities that share a simplex (lambda_5-6, 7-8) to at most 1, in place."""
    for a, b in ((OBSERVED_LABEL, DATABASE_LABEL), (COPY_SPACING, OBSERVED_SPACING)):
        total = policy[a] + policy[b]
        if total > 1:
            policy[a] /= total
            policy[b] /= total


def sample_policies(count: int, rng: np.random.Generator) -> Float64Array:
    """Draw (count, POLICY_LENGTH) random policies with uniform probabilities."""
    out = rng.uniform(size=(count, POLICY_LENGTH))
    out[:, 8] = rng.uniform(0.6, 1.0, count)  # most elements have their neighbour's label
    out[:, 3:8] = np.argsort(out[:, 3:8], axis=1)
    for policy in out:
        project_to_simplex(policy)
    return out
