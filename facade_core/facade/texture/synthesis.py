"""Synthesis of a facade of any size from one exemplar (tiles paper, sections 3.2 and 3.3)."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float64Array, Int32Array, Int64Array, IntArray, NumericArray, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.types import Lattice, Synthesis
from facade_core.facade.texture.genetic import POPULATION_SIZE, NodeConstraints, evolve_tilings
from facade_core.facade.texture.settings import SYNTHESIS
from facade_core.facade.texture.tile_composition import compose_tiles
from facade_core.facade.texture.tiling_energy import EnergyTables, tabulate_energy
from facade_core.facade.texture.validation import check_exemplar_image, check_exemplar_labels


def synthesize(image: UInt8Array, labels: UInt8Array, size: tuple[int, int], *, seed: int = 0) -> Synthesis:
    """Compose the exemplar's tiles to size = (H', W') pixels (Eq. 4-6, Algo. 2).

    Top and bottom rows of the result come from the exemplar's top and bottom rows.

    Parameters
    ----------
    image : (H, W, 3) uint8 exemplar.
    labels : (H, W) uint8 class ids.
    size : (H', W') pixels.
    seed : seed of the genetic algorithm.

    Raises
    ------
    ImageError
        For bad arrays or a size below 8 px.
    """
    from facade_core.parsing.lattice import lattice

    check_exemplar_image(image)
    check_exemplar_labels(image, labels)
    if min(size) < 8:
        raise ImageError(f"synthesize: size {tuple(size)} is too small; ask for at least 8 x 8 px")
    return synthesize_on_lattice(image, labels, lattice(labels), size, seed=seed)


def synthesize_on_lattice(
    image: UInt8Array,
    labels: UInt8Array,
    grid: Lattice,
    size: tuple[int, int],
    *,
    seed: int = 0,
    generations: int = SYNTHESIS.generations,
) -> Synthesis:
    """Synthesize on a given lattice: M' = [H' M / H] rows and N' = [W' N / W] columns of tiles.

    Parameters
    ----------
    image : (H, W, 3) uint8 exemplar.
    labels : (H, W) uint8 class ids.
    grid : lattice of the exemplar.
    size : (H', W') pixels.
    """
    tall, wide = len(grid.rows) - 1, len(grid.columns) - 1
    # A cell is at least 2 px, which bounds the rows and columns.
    rows = min(max(1, round(size[0] * tall / image.shape[0])), size[0] // 2)
    columns = min(max(1, round(size[1] * wide / image.shape[1])), size[1] // 2)
    tiles, lowest = evolve_random_tilings(
        tabulate_energy(image, labels, grid), grid, (rows, columns), np.random.default_rng(seed), generations
    )
    heights, widths = mean_tile_sizes(grid, tiles)
    picture, carried = compose_tiles(
        image, labels, grid, tiles, cell_borders(heights, size[0]), cell_borders(widths, size[1])
    )
    return Synthesis(picture, carried, tiles, float(lowest[-1]))


def evolve_random_tilings(
    tables: EnergyTables,
    grid: Lattice,
    shape: tuple[int, int],
    rng: np.random.Generator,
    generations: int = SYNTHESIS.generations,
) -> tuple[Int32Array, Float64Array]:
    """Evolve random tilings (Algo. 2).

    Parameters
    ----------
    tables : energy of pairs of tiles.
    grid : lattice of the exemplar.
    shape : (M', N') tiles.
    rng : generator of the algorithm.

    Returns
    -------
    The fittest tiling and the lowest energy of every generation.
    """
    tall, wide = len(grid.rows) - 1, len(grid.columns) - 1
    may_row = np.ones((shape[0], tall), bool)
    may_row[0], may_row[-1] = np.eye(tall, dtype=bool)[[0, -1]]
    source_row = rng.integers(0, tall, (POPULATION_SIZE, *shape))
    source_row[:, 0], source_row[:, -1] = 0, tall - 1
    return evolve_tilings(
        tables,
        source_row * wide + rng.integers(0, wide, (POPULATION_SIZE, *shape)),
        NodeConstraints(
            may_row.astype(np.int64),
            np.ones((shape[1], wide), np.int64),
            np.zeros(shape, bool),
            np.ones((tall, wide), bool),
        ),
        generations=generations,
        rng=rng,
    )


def mean_tile_sizes(grid: Lattice, tiles: IntArray) -> tuple[Float64Array, Float64Array]:
    """Return the mean tile height of every row and the mean tile width of every column, in exemplar pixels.

    Parameters
    ----------
    grid : lattice of the exemplar.
    tiles : (M, N) int32.
    """
    across = len(grid.columns) - 1
    return np.diff(grid.rows)[tiles // across].mean(1), np.diff(grid.columns)[tiles % across].mean(0)


def cell_borders(sizes: NumericArray, total: int) -> Int64Array:
    """Return integer cell borders 0 ... total whose spacings are proportional to sizes.

    Parameters
    ----------
    sizes : (n,) sizes.
    total : last border.
    """
    borders = np.concatenate([[0.0], np.cumsum(sizes)])
    rounded: Int64Array = np.rint(borders * (total / borders[-1])).astype(np.int64)
    return rounded
