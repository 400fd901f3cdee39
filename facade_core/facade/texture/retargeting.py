"""Retarget an exemplar's style to a wall of any metric size: repeat or drop floors and bays, then refine tiles."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int32Array, IntArray, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.labels import FacadeClass
from facade_core.core.types import Lattice, Synthesis
from facade_core.facade.texture.genetic import POPULATION_SIZE, NodeConstraints, evolve_tilings
from facade_core.facade.texture.settings import RETARGETING
from facade_core.facade.texture.shortest_walks import (
    WalkCosts,
    cheapest_walk,
    find_crossing_elements,
    part_transition_costs,
    price_cut_elements,
)
from facade_core.facade.texture.synthesis import cell_borders, mean_tile_sizes
from facade_core.facade.texture.tile_composition import compose_tiles
from facade_core.facade.texture.tiling_energy import EnergyTables, tabulate_energy
from facade_core.facade.texture.validation import check_exemplar_image, check_exemplar_labels
from facade_core.parsing.floor_structure import (
    FloorsAndBays,
    fill_sky_and_unknown,
    find_floors_and_bays,
    floor_bay_lattice,
    spans_above_threshold,
)


@dataclass(frozen=True, eq=False)
class ExemplarAnalysis:
    """Analysed exemplar: lattice, and prices of transitions between floors and bays.

    Attributes
    ----------
    image : (H, W, 3) uint8.
    labels : (H, W) uint8 class ids.
    structure : floors and bays.
    grid : lattice of three rows per floor and three columns per bay.
    floor_price : (F, F) price of showing one floor above another.
    bay_price : per band, prices of showing one bay left of another.
    doors : (B,) bool bays with a door.
    """

    image: UInt8Array
    labels: UInt8Array
    structure: FloorsAndBays
    grid: Lattice
    floor_price: Float64Array
    bay_price: dict[str, WalkCosts]
    doors: BoolArray

    @cached_property
    def tables(self) -> EnergyTables:
        """Return the tabulated energy of tilings of the exemplar, with prices of elements that tiles cut."""
        tables = tabulate_energy(self.image, self.labels, self.grid)
        across = find_crossing_elements(self.labels, self.grid.columns, self.grid.rows)
        down = find_crossing_elements(self.labels.T, self.grid.rows, self.grid.columns).T
        right = price_cut_elements(across[:, 1:].reshape(1, -1), across[:, :-1].reshape(1, -1))
        below = price_cut_elements(down[1:].reshape(1, -1), down[:-1].reshape(1, -1))
        return tables._replace(photo_right=tables.photo_right + right, photo_below=tables.photo_below + below)


def retarget(
    image: UInt8Array,
    labels: UInt8Array,
    size_m: tuple[float, float],
    *,
    floors: int,
    columns: int | None = None,
    metres_per_pixel: float,
    n: int = 1,
    seed: int = 0,
) -> list[Synthesis]:
    """Show the exemplar's style on a wall of size_m = (height, width) metres: n different facades.

    Doors and shops stay on the ground, the roof on top; the sky is left out, and so is the roof where a low wall
    would squeeze it. A wall too narrow for half a bay is left blank unless `columns` is given.

    Floors and bays follow the cheapest walk over the exemplar's. The genetic algorithm of the tiles paper then
    refines the upper floors: a node takes only tiles of its own band and of its own place within a bay. Synthesis
    numbers tiles in the lattice of three rows per floor and three columns per bay.

    Parameters
    ----------
    image : (H, W, 3) uint8 exemplar.
    labels : (H, W) uint8 class ids of the exemplar.
    size_m : (height, width) metres; results have round(size_m / metres_per_pixel) pixels.
    floors : rows of windows, the roof's included, and the ground floor, with or without windows of its own.
    columns : window columns; by default as many as keep the windows' proportions.
    metres_per_pixel : scale of the results.
    n : number of facades.
    seed : seed of the walks and the refinement.

    Raises
    ------
    ImageError
        For bad arrays, sizes or counts, and for labels without windows.
    """
    style = analyse_exemplar(image, labels)
    if not metres_per_pixel > 0 or not min(size_m) > 0:
        raise ImageError(f"retarget: size {size_m} m at {metres_per_pixel} m/px; pass positive numbers")
    size = round(size_m[0] / metres_per_pixel), round(size_m[1] / metres_per_pixel)
    if min(size) < 2:
        raise ImageError(f"retarget: {size_m} m at {metres_per_pixel} m/px is {size} px; pass fewer metres per pixel")
    if floors < 1 or (columns is not None and columns < 1):
        raise ImageError(f"retarget: floors={floors}, columns={columns}; pass at least 1")
    results: list[Synthesis] = []
    for k in range(n):
        rng = np.random.default_rng([seed, k])
        for attempt in range(4):
            result = _compose_facade(
                style, size, floors, columns, rng, noise=RETARGETING.price_noise * (k + attempt > 0) * (1 + attempt)
            )
            if not any(np.array_equal(result.tiles, other.tiles) for other in results):
                break
        results.append(result)
    return results


def analyse_exemplar(image: UInt8Array, labels: UInt8Array) -> ExemplarAnalysis:
    """Analyse an exemplar: find its floors, bays and doors, and price transitions.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    labels : (H, W) uint8 class ids.

    Raises
    ------
    ImageError
        For bad arrays, and for labels without windows.
    """
    check_exemplar_image(image)
    check_exemplar_labels(image, labels)
    exemplar = find_floors_and_bays(labels)
    if exemplar is None:
        raise ImageError("retarget: the exemplar's labels show no windows; pick another exemplar or label it again")
    labels = fill_sky_and_unknown(labels)
    above = labels[: exemplar.ground_top]  # doors there are of balconies, shops are errors of the parser
    above[above == FacadeClass.DOOR], above[above == FacadeClass.SHOP] = FacadeClass.WINDOW, FacadeClass.WALL
    grid = floor_bay_lattice(exemplar)
    bay_cuts = np.asarray(exemplar.bay_cuts)
    bands = {"roof": (exemplar.top, _roof_bottom(exemplar)), "ground": (exemplar.ground_top, exemplar.bottom)}
    bands["middle"] = (bands["roof"][1], exemplar.floor_cuts[-1 - (exemplar.kinds[-1] == "ground")])
    bay_price = {
        name: part_transition_costs(
            image[a:b], labels[a:b], bay_cuts, [0, *(cut - a for cut in exemplar.floor_cuts if a < cut < b), b - a]
        )
        for name, (a, b) in bands.items()
        if b - a >= 2
    }
    rows = image[:, bay_cuts[0] : bay_cuts[-1]].transpose(1, 0, 2)
    floor_price = part_transition_costs(rows, labels.T, np.asarray(exemplar.floor_cuts), exemplar.bay_cuts).step
    floor_price[:, 0] += RETARGETING.eaves_price
    street = (labels[exemplar.ground_top :] == FacadeClass.DOOR).sum(0).astype(np.float64)
    centres = [(first + end - 1) / 2 for first, end in spans_above_threshold(street, 0.25 * street.max())]
    doors = np.histogram(centres, bay_cuts)[0] > 0
    return ExemplarAnalysis(image, labels, exemplar, grid, floor_price, bay_price, doors)


def _roof_bottom(exemplar: FloorsAndBays) -> int:
    return exemplar.floor_cuts[sum(kind == "roof" for kind in exemplar.kinds)]


def _compose_facade(
    style: ExemplarAnalysis,
    size: tuple[int, int],
    floors: int,
    columns: int | None,
    rng: np.random.Generator,
    *,
    noise: float,
) -> Synthesis:
    floor_indices, scale = choose_exemplar_floors(style, size[0], floors, rng, noise)
    exemplar = style.structure
    bay_sizes = np.diff(exemplar.bay_cuts)
    fitting = size[1] / (scale * float(bay_sizes.mean()))
    blank = columns is None and fitting < 0.5
    count = 1 if blank else columns or max(1, round(fitting))
    variants = [initial_tiling(style, floor_indices, count, blank, rng, noise * (k + 1) ** 0.5) for k in range(4)]
    tiles, value = refine_tiling(style, floor_indices, variants, blank, rng)
    heights, widths = mean_tile_sizes(style.grid, tiles)
    soft = np.array([True]) if blank else np.tile([True, False, True], count)
    across = cell_borders(fit_sizes_to_total(widths * scale, soft, size[1]), size[1])
    picture, carried = compose_tiles(
        style.image, style.labels, style.grid, tiles, cell_borders(heights, size[0]), across
    )
    return Synthesis(picture, carried, tiles, value)


def choose_exemplar_floors(
    style: ExemplarAnalysis, height: int, floors: int, rng: np.random.Generator, noise: float
) -> tuple[list[int], float]:
    """Choose the exemplar floors to show from top to bottom, and the scale that fits them.

    Parameters
    ----------
    style : analysed exemplar.
    height : height of the wall in exemplar pixels.
    floors : wanted number of floors.
    rng : draws the noise.
    noise : log-normal deviation of prices.

    Returns
    -------
    Floor indices, -1 for a ground band without windows, and the scale.
    """
    exemplar = style.structure
    kinds = np.array(exemplar.kinds)
    middle = np.flatnonzero(kinds == "middle")
    roofs = list(np.flatnonzero(kinds == "roof"))
    ground = [len(kinds) - 1] if kinds[-1] == "ground" else ([-1] if exemplar.bottom > exemplar.floor_cuts[-1] else [])
    sizes = np.append(np.diff(exemplar.floor_cuts)[: len(kinds)], exemplar.bottom - exemplar.floor_cuts[len(kinds)])
    price = style.floor_price * np.exp(noise * rng.standard_normal(style.floor_price.shape))
    standing = exemplar.has_ground_band or kinds[-1] == "ground"
    best: tuple[float, list[int], float] | None = None
    for kept in (roofs, roofs[-1:], []):
        wanted = floors - len(kept) - standing
        if wanted < 0 or (wanted == 0 and not kept and max(ground, default=-1) < 0):  # no row of windows would remain
            continue
        start = price[kept[-1], middle] if kept else 0.3 * np.arange(len(middle))
        end = price[middle, ground[0]] if ground and ground[0] >= 0 else 0.05 * np.arange(len(middle))[::-1]
        ends = np.asarray(start, np.float64), np.asarray(end, np.float64)
        walk: IntArray | list[int] = (
            middle[cheapest_walk(price[np.ix_(middle, middle)], *ends, wanted)] if wanted else []
        )
        floor_indices = [int(f) for f in [*kept, *walk, *ground]]
        scale = height / float(sizes[floor_indices].sum())
        strain = abs(np.log(scale)) + 0.15 * (len(roofs) - len(kept))
        if best is None or strain < best[0] - 1e-9:
            best = strain, floor_indices, scale
    if best is None:  # fewer floors than the ground band has
        floor_indices = [int(g) for g in ground] or [int(middle[-1])]
        best = 0.0, floor_indices, height / float(sizes[floor_indices].sum())
    return best[1], float(np.clip(best[2], 0.4, 2.5))


def initial_tiling(
    style: ExemplarAnalysis, floors: list[int], count: int, blank: bool, rng: np.random.Generator, noise: float
) -> Int32Array:
    """Return a first tiling: on each floor the cheapest walk over the bays of its band."""
    exemplar, wide = style.structure, len(style.grid.columns) - 1
    bays = len(exemplar.bays)
    shake = np.exp(noise * rng.standard_normal((bays, bays)))
    walks = {}
    for band, costs in style.bay_price.items():
        price, ends = costs.step * shake, (costs.start, costs.end)
        if band == "ground" and style.doors.any():
            # of the exemplar's width, with one door each
            houses = max(1, count // max(bays, RETARGETING.min_house_bays))
            apart = price + np.diag(style.doors)  # no door is beside itself
            walks[band] = cheapest_walk(apart, *ends, count, marked=style.doors, max_marked=houses)
        else:
            walks[band] = cheapest_walk(price, *ends, count)
    if blank:
        pier = np.zeros(1, int) + 3 * int(np.argmax(np.diff(style.grid.columns)[::3]))
    lines = []
    for floor in floors:
        kind = "ground" if floor < 0 else exemplar.kinds[floor]
        walk = walks.get(kind, walks["middle"])
        across = pier if blank else (3 * walk[:, None] + np.arange(3)).ravel()
        lines += [row * wide + across for row in lattice_rows(style, floor)]
    return np.array(lines, np.int32)


def lattice_rows(style: ExemplarAnalysis, floor: int) -> range:
    """Return the lattice rows of a floor, -1 for the ground band."""
    return (
        range(3 * len(style.structure.floors), len(style.grid.rows) - 1)
        if floor < 0
        else range(3 * floor, 3 * floor + 3)
    )


def refine_tiling(
    style: ExemplarAnalysis, floors: list[int], variants: list[Int32Array], blank: bool, rng: np.random.Generator
) -> tuple[Int32Array, float]:
    """Refine tilings by the genetic algorithm within bands.

    Roof, ground and borders stay; floors exchange tiles of similar height.

    Parameters
    ----------
    style : analysed exemplar.
    floors : exemplar floors from top to bottom.
    variants : first tilings, (M, N) each.
    blank : True for a wall without bays; nothing changes.
    rng : generator of the algorithm.

    Returns
    -------
    (M, N) int32 tiling and its energy.
    """
    exemplar, grid = style.structure, style.grid
    population = np.stack([variants[k % len(variants)] for k in range(POPULATION_SIZE)])
    tall, wide = len(grid.rows) - 1, len(grid.columns) - 1
    height = np.diff(grid.rows)
    kinds = ["ground" if s < 0 else exemplar.kinds[s] for s in floors for _ in lattice_rows(style, s)]
    source_kinds = np.array(
        [kind for kind in exemplar.kinds for _ in range(3)] + ["base"] * (tall - 3 * len(exemplar.floors))
    )
    own = np.array([row for s in floors for row in lattice_rows(style, s)])
    alike = np.abs(np.log(height[own][:, None] / height[None])) < 0.15
    same_place = (own[:, None] % 3) == (np.arange(tall)[None] % 3)
    rows = alike & same_place & (source_kinds == "middle")[None]
    rows[np.arange(len(own)), own] = True
    place = np.arange(population.shape[2]) % 3
    columns = place[:, None] == (np.arange(wide)[None] % 3)
    frozen = np.zeros(population.shape[1:], bool)
    frozen[np.array(kinds) != "middle"] = True
    frozen[:, [0, -1]] = True
    if blank:
        frozen[:] = True
    tiles, lowest = evolve_tilings(
        style.tables,
        population,
        NodeConstraints(rows.astype(np.int64), columns.astype(np.int64), frozen, np.ones((tall, wide), bool)),
        generations=RETARGETING.generations,
        rng=rng,
    )
    return tiles, float(lowest[-1])


def fit_sizes_to_total(sizes: Float64Array, soft: BoolArray, total: float) -> Float64Array:
    """Fit sizes to a total: soft ones (piers) change first, within limits, then all, then soft ones alone.

    Hard ones change beyond `window_stretch` only where they exceed the total.

    Parameters
    ----------
    sizes : (n,) sizes.
    soft : (n,) bool.
    total : wanted sum.
    """
    room = total - sizes[~soft].sum()
    stretch = float(np.clip(room / sizes[soft].sum(), *RETARGETING.pier_stretch))
    fitted = np.where(soft, sizes * stretch, sizes)
    common = total / float(fitted.sum())
    limited = float(np.clip(common, *RETARGETING.window_stretch))
    room = total - limited * float(sizes[~soft].sum())
    if limited == common or room <= 0:
        scaled: Float64Array = fitted * common
        return scaled
    return np.where(soft, sizes * (room / sizes[soft].sum()), sizes * limited)
