"""Genetic algorithm of the tiles paper as it is written: every energy is computed whole (section 3.3, Eq. 4, Algo. 2).

`facade_core.facade.texture.genetic` is what a run uses: it computes changes of the energy, and also tries single mutations.
"""

from __future__ import annotations

import numpy as np

from facade_core.core.types import Lattice
from facade_core.facade.texture.genetic import ELITE_SIZE, MAX_BLOCK, POPULATION_SIZE
from facade_core.facade.texture.tiling_energy import EnergyTables


def search_plainly(tab: EnergyTables, shape: tuple[int, int], grid: Lattice, generations: int, seed: int) -> float:
    """Return the final energy of Algo. 2 on a grid of shape (M, N), with tiles of the exemplar's grid."""
    rng = np.random.default_rng(seed)
    tall, wide = len(grid.rows) - 1, len(grid.columns) - 1

    def random_tiling() -> np.ndarray:
        rows = rng.integers(0, tall, shape)
        rows[0], rows[-1] = 0, tall - 1
        return np.asarray(rows * wide + rng.integers(0, wide, shape))

    def tournament() -> np.ndarray:
        a, b = rng.integers(0, POPULATION_SIZE, 2)
        return people[a if fitness[a] <= fitness[b] else b].copy()

    def mutate(tiles: np.ndarray) -> None:
        (h, w), y, x = rng.integers(1, MAX_BLOCK + 1, 2), rng.integers(shape[0]), rng.integers(shape[1])
        i = {0: 0, shape[0] - 1: tall - 1}.get(int(y), int(rng.integers(tall)))
        j = int(rng.integers(wide))
        for a in range(min(h, shape[0] - y, tall - i)):
            row, source = y + a, i + a
            if (row == 0 and source != 0) or (row == shape[0] - 1 and source != tall - 1):
                continue
            count = min(w, shape[1] - x, wide - j)
            tiles[row, x : x + count] = source * wide + np.arange(j, j + count)

    people = [random_tiling() for _ in range(POPULATION_SIZE)]
    fitness = np.array([plain_energy(tab, tiles) for tiles in people])
    for _ in range(generations):
        order = np.argsort(fitness)
        heirs = [people[k] for k in order[:ELITE_SIZE]]
        values = list(fitness[order[:ELITE_SIZE]])
        while len(heirs) < POPULATION_SIZE:
            first, second = tournament(), tournament()
            y, x = rng.integers(shape[0]), rng.integers(shape[1])
            h, w = rng.integers(1, MAX_BLOCK + 1, 2)
            block = np.s_[y : y + h, x : x + w]
            first[block], second[block] = second[block].copy(), first[block].copy()
            for child in (first, second):
                mutate(child)
                heirs.append(child)
                values.append(plain_energy(tab, child))
        people, fitness = heirs, np.array(values)
    return float(fitness.min())


def plain_energy(tab: EnergyTables, tiles: np.ndarray) -> float:
    """Return the energy of a tiling (M, N), Eq. 4."""
    out = tab.photo_right[tiles[:, :-1], tiles[:, 1:]].sum(dtype=float)
    out += tab.photo_below[tiles[:-1], tiles[1:]].sum(dtype=float)
    kinds = tab.kind[tiles]
    for grid, templates, scale in (
        (kinds, tab.templates_right, tab.scale_right),
        (kinds.T, tab.templates_below, tab.scale_below),
    ):
        order = templates.shape[1]
        squared = sum(
            tab.kind_distance[grid[:, k : grid.shape[1] - order + 1 + k]][..., templates[:, k]] for k in range(order)
        )
        out += np.asarray(squared).min(-1).sum() * scale
    return float(out)
