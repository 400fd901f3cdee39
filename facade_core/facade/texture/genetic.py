"""Genetic algorithm that assigns exemplar tiles to grid nodes (tiles paper, section 3.3, Algo. 2)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int32Array, Int64Array
from facade_core.core.numba_cache import njit
from facade_core.core.small_sort import argsort_few
from facade_core.facade.texture.tiling_energy import EnergyTables, sum_costs, update_costs

POPULATION_SIZE = 10
ELITE_SIZE = 4
MAX_BLOCK = 5
_DRAWS_PER_PAIR = 20  # random numbers that one pair of children uses


class NodeConstraints(NamedTuple):
    """Allowed tiles of the nodes of the new grid.

    Attributes
    ----------
    rows : (M, rows) 1 for exemplar rows that a grid row may take, else 0.
    columns : (N, columns) 1 for exemplar columns that a grid column may take, else 0.
    frozen : (M, N) bool nodes that never change.
    usable : (rows, columns) bool exemplar tiles that any node may take.
    """

    rows: Int64Array
    columns: Int64Array
    frozen: BoolArray
    usable: BoolArray


def evolve_tilings(
    tables: EnergyTables,
    population: Int32Array,
    nodes: NodeConstraints,
    *,
    generations: int,
    rng: np.random.Generator,
) -> tuple[Int32Array, Float64Array]:
    """Evolve tilings and return the fittest one with the history of the lowest energy.

    Blocks are up to 5 x 5 (U = 5), parents win 2-tournaments, the 4 best survive (Q = 10, q = 4). Beyond the paper,
    as many mutations as there were children are tried on the fittest tiling and kept if they do no harm, which lowers
    the energy by a tenth to a quarter. The last of the lowest energies includes them.

    Parameters
    ----------
    tables : energy of pairs of tiles.
    population : (POPULATION_SIZE, M, N) int32 first generation.
    nodes : allowed tiles.
    generations : number of generations.
    rng : draws crossovers and mutations.

    Returns
    -------
    (M, N) int32 tiling, and (generations + 1,) float64 lowest energies (Eq. 4).
    """
    children = POPULATION_SIZE - ELITE_SIZE
    evolved: tuple[Int32Array, Float64Array] = _evolve(
        tables,
        nodes,
        population.astype(np.int32),
        rng.random((generations, children // 2, _DRAWS_PER_PAIR)),
        rng.random((generations * children, 6)),
    )
    return evolved


@njit(cache=True)
def _draw_index(number: float, count: int) -> int:
    return min(int(number * count), count - 1)


@njit(cache=True)
def _count_true(flags: Int64Array) -> int:
    count = 0
    for flag in flags:
        count += flag
    return count


@njit(cache=True)
def _mutate(tiles: Int32Array, u: Float64Array, nodes: NodeConstraints) -> tuple[int, int, int, int]:
    """Copy a block of the exemplar grid over a block of the new one, as far as the constraints allow.

    Returns the rows and columns, half-open, that hold all changes; without a change there are none.
    """
    rows, columns, frozen, usable = nodes
    height, width = usable.shape
    h, w = 1 + _draw_index(u[0], MAX_BLOCK), 1 + _draw_index(u[1], MAX_BLOCK)
    y, x = _draw_index(u[2], tiles.shape[0]), _draw_index(u[3], tiles.shape[1])
    nth, i = _draw_index(u[4], _count_true(rows[y])), -1
    while nth >= 0:
        i += 1
        nth -= rows[y, i]
    nth, j = _draw_index(u[5], _count_true(columns[x])), -1
    while nth >= 0:
        j += 1
        nth -= columns[x, j]
    h, w = min(h, tiles.shape[0] - y, height - i), min(w, tiles.shape[1] - x, width - j)
    top, low, left, edge = h, 0, w, 0
    for a in range(h):
        for b in range(w):
            if rows[y + a, i + a] and columns[x + b, j + b] and usable[i + a, j + b] and not frozen[y + a, x + b]:
                tile = (i + a) * width + j + b
                if tiles[y + a, x + b] != tile:
                    tiles[y + a, x + b] = tile
                    top, low, left, edge = min(top, a), max(low, a + 1), min(left, b), max(edge, b + 1)
    return y + top, y + low, x + left, x + edge


@njit(cache=True)
def _exchange_block(
    one: Int32Array, other: Int32Array, y0: int, y1: int, x0: int, x1: int
) -> tuple[int, int, int, int]:
    """Exchange a block between two tilings; returns the rows and columns that hold all changes, as `_mutate`."""
    top, low, left, edge = y1, y0, x1, x0
    for y in range(y0, y1):
        for x in range(x0, x1):
            if one[y, x] != other[y, x]:
                one[y, x], other[y, x] = other[y, x], one[y, x]
                top, low, left, edge = min(top, y), max(low, y + 1), min(left, x), max(edge, x + 1)
    return top, low, left, edge


@njit(cache=True)
def _copy_individual(tiles: Int32Array, cost: Float64Array, to: Int32Array, to_cost: Float64Array) -> None:
    """Copy an individual and its cost over another; by loops, since slices take numba seconds to compile."""
    for y in range(tiles.shape[0]):
        for x in range(tiles.shape[1]):
            to[y, x] = tiles[y, x]
    for term in range(cost.shape[0]):
        for y in range(tiles.shape[0]):
            for x in range(tiles.shape[1]):
                to_cost[term, y, x] = cost[term, y, x]


@njit(cache=True)
def _evolve(
    tab: EnergyTables, nodes: NodeConstraints, population: Int32Array, draws: Float64Array, tries: Float64Array
) -> tuple[Int32Array, Float64Array]:
    count, tall, wide = population.shape
    cost = np.zeros((count, 4, tall, wide))
    fitness = np.empty(count)
    start = int(np.int64(0))  # numba compiles a callee again for a literal
    for k in range(count):
        update_costs(tab, cost[k], population[k], start, tall, start, wide)
        fitness[k] = sum_costs(cost[k])
    lowest = np.empty(draws.shape[0] + 1)
    heirs, heir_cost, heir_fitness = population.copy(), cost.copy(), fitness.copy()
    for generation in range(draws.shape[0]):
        order = argsort_few(fitness)
        lowest[generation] = fitness[order[0]]
        for k in range(ELITE_SIZE):
            heir_fitness[k] = fitness[order[k]]
            _copy_individual(population[order[k]], cost[order[k]], heirs[k], heir_cost[k])
        for pair in range(draws.shape[1]):
            u = draws[generation, pair]
            a, b = _draw_index(u[0], count), _draw_index(u[1], count)
            mother = a if fitness[a] <= fitness[b] else b
            a, b = _draw_index(u[2], count), _draw_index(u[3], count)
            father = a if fitness[a] <= fitness[b] else b
            first, second = ELITE_SIZE + 2 * pair, ELITE_SIZE + 2 * pair + 1
            _copy_individual(population[mother], cost[mother], heirs[first], heir_cost[first])
            _copy_individual(population[father], cost[father], heirs[second], heir_cost[second])
            y, x = _draw_index(u[4], tall), _draw_index(u[5], wide)
            y1, x1 = min(tall, y + 1 + _draw_index(u[6], MAX_BLOCK)), min(wide, x + 1 + _draw_index(u[7], MAX_BLOCK))
            y, y1, x, x1 = _exchange_block(heirs[first], heirs[second], y, y1, x, x1)
            for k in range(2):
                child = first + k
                update_costs(tab, heir_cost[child], heirs[child], y, y1, x, x1)
                top, low, left, edge = _mutate(heirs[child], u[8 + 6 * k :], nodes)
                update_costs(tab, heir_cost[child], heirs[child], top, low, left, edge)
                heir_fitness[child] = sum_costs(heir_cost[child])
        population, heirs = heirs, population
        cost, heir_cost = heir_cost, cost
        fitness, heir_fitness = heir_fitness, fitness
    best = np.argmin(fitness)
    tiles, held, lowest[-1] = population[best], cost[best], fitness[best]
    other, other_cost = heirs[0], heir_cost[0]
    _copy_individual(tiles, held, other, other_cost)
    for k in range(tries.shape[0]):
        top, low, left, edge = _mutate(other, tries[k], nodes)
        if top >= low:
            continue
        update_costs(tab, other_cost, other, top, low, left, edge)
        energy = sum_costs(other_cost)
        if energy <= lowest[-1]:
            lowest[-1] = energy
            tiles, held, other, other_cost = other, other_cost, tiles, held
        _copy_individual(tiles, held, other, other_cost)
    return tiles.copy(), lowest
