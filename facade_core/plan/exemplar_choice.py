"""Choice of exemplars for buildings without imagery: by fit, by street character, and unlike the neighbours."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import shapely

from facade_core.core.arrays import BoolArray, Float64Array, Int32Array, Int64Array
from facade_core.plan.exemplar_style import ExemplarLibrary
from facade_core.plan.settings import EXEMPLAR_CHOICE, PLANNED_FACADES


@dataclass(frozen=True)
class ExemplarTargetWalls:
    """Walls that need an exemplar, as columns of n.

    Attributes
    ----------
    width, height : (n,) metres.
    floors : (n,).
    building, street : (n,) hashes of ids, independent of other buildings and streets.
    ends : (n, 2, 2) metres, both ends seen from above.
    shops : (n,) 1 with mapped shops, 0 without, -1 where unknown.
    style : (n,) number of the facade style of the building; empty: any.
    """

    width: Float64Array
    height: Float64Array
    floors: Int32Array
    building: Int64Array
    street: Int64Array
    ends: Float64Array
    shops: Int64Array
    style: Int64Array = field(default_factory=lambda: np.zeros(0, np.int64))


def choose_exemplars(
    walls: ExemplarTargetWalls, library: ExemplarLibrary, *, seed: int, kept: Int64Array | None = None
) -> Int64Array:
    """Choose an exemplar for each wall; the walls of one building share theirs.

    Bad exemplars are left out while another is left. The misfit is that of the building's widest wall: floors, floor
    height, families of the street, and quality of the upper floors. A random cost by (seed, building) adds variety.
    Neighbours take different exemplars while there are others as good, then the one with the farthest use, and avoid
    similar ones. A choice depends on the neighbourhood only, not on order or number, except that kept choices are there
    before all others.

    Parameters
    ----------
    walls : walls to choose for.
    library : exemplars to choose from.
    seed : random seed.
    kept : (n,) exemplars of walls whose building keeps its own, -1 for walls of a building that chooses.

    Returns
    -------
    (n,) index of the exemplar.
    """
    numbers, row = np.unique(walls.building, return_inverse=True)
    if not len(numbers):
        return np.zeros(0, np.int64)
    order = np.lexsort((walls.height, walls.street, -walls.width, row))
    main = order[np.searchsorted(row[order], np.arange(len(numbers)))]
    misfit = _misfit_costs(walls, main, library)
    draws = _draw_by_building(numbers, seed, 1 + misfit.shape[1])
    misfit += EXEMPLAR_CHOICE.random_cost * draws[:, 1:]
    misfit += EXEMPLAR_CHOICE.other_family_cost * ~_is_in_street_families(walls.street[main], library.family, seed)
    near, metres = _neighbouring_buildings(walls.ends, row, len(numbers))
    body = np.asarray(library.body, float)
    misfit[:, body < EXEMPLAR_CHOICE.min_body * float(body.max())] = np.inf

    chosen = np.full(len(numbers), -1) if kept is None else kept[main]
    order_of_choice = np.argsort(draws[:, 0], kind="stable")
    for i in order_of_choice[chosen[order_of_choice] < 0].tolist():
        chosen[i] = _cheapest_exemplar(misfit[i], chosen[near[i]], metres[i], library)
    return chosen[row]


def choose_ground_floors(
    library: ExemplarLibrary,
    chosen: Int64Array,
    *,
    building: Int64Array,
    width: Float64Array,
    shops: Int64Array,
    seed: int,
) -> Int64Array:
    """Choose the exemplar whose ground floor each wall shows; the walls of one building share theirs.

    It is well seen, like the wall's exemplar in colour, light and form, fits the building's narrowest front, and has shops
    where the map has them alone. The exemplar's own ground floor is the most like it. A plain one is better than one that is
    nothing like it.

    Parameters
    ----------
    library : exemplars to choose from.
    chosen : (n,) exemplar of each wall.
    building, width, shops : (n,) as in `ExemplarTargetWalls`.
    seed : random seed.

    Returns
    -------
    (n,) index of the exemplar, -1 for a plain ground floor.
    """
    foot = np.asarray(library.foot, float)
    if not len(chosen):
        return np.zeros(0, np.int64)
    numbers, first, row = np.unique(building, return_index=True, return_inverse=True)
    narrowest, mapped = np.full(len(numbers), np.inf), np.full(len(numbers), -1)
    is_front = width >= PLANNED_FACADES.min_facade_width_m
    np.minimum.at(narrowest, row[is_front], width[is_front])
    np.maximum.at(mapped, row, shops)
    is_unfit = EXEMPLAR_CHOICE.min_front_share * np.asarray(library.fronts, float) > narrowest[:, None]
    draws = np.array([np.random.default_rng([seed, number, 1]).random(len(foot)) for number in numbers.tolist()])
    draws[np.arange(len(first)), chosen[first]] = 0.0
    cost = library.distance[chosen[first]] + EXEMPLAR_CHOICE.foot_cost * (1 - foot)
    has_shops, mapped = np.asarray(library.shops, float) > 0, mapped[:, None]
    is_unfit |= has_shops & (mapped == 0)
    cost += EXEMPLAR_CHOICE.shop_cost * (~has_shops & (mapped > 0)) + EXEMPLAR_CHOICE.unfit_cost * is_unfit
    if library.style is not None:
        own = np.asarray(library.style)[chosen[first]]
        cost += EXEMPLAR_CHOICE.other_style_cost * library.is_other_style(own)
    cost += EXEMPLAR_CHOICE.random_cost * draws
    cost[:, foot < EXEMPLAR_CHOICE.min_foot] = np.inf
    best = np.where(cost.min(axis=1) < EXEMPLAR_CHOICE.plain_cost, cost.argmin(axis=1), -1)
    return np.asarray(best[row], np.int64)


@dataclass(frozen=True)
class ExemplarChoiceOrder:
    """Order in which the buildings of a city choose their exemplars.

    Attributes
    ----------
    numbers : (b,) building hashes, ascending.
    predecessors : rows of the neighbours that choose before each building.
    """

    numbers: Int64Array
    predecessors: tuple[Int64Array, ...]

    def dependencies(self, buildings: Int64Array) -> Int64Array:
        """Return the buildings (k,) whose choices some buildings (c,) depend on, these included, at any depth."""
        found = np.isin(self.numbers, buildings)
        waiting = np.flatnonzero(found).tolist()
        while waiting:
            rows = self.predecessors[waiting.pop()]
            new = rows[~found[rows]]
            found[new] = True
            waiting += new.tolist()
        return self.numbers[found]


def exemplar_choice_order(walls: ExemplarTargetWalls, *, seed: int) -> ExemplarChoiceOrder:
    """Compute the order in which `choose_exemplars` visits buildings."""
    numbers, row = np.unique(walls.building, return_inverse=True)
    near, _ = _neighbouring_buildings(walls.ends, row, len(numbers))
    rank = np.argsort(np.argsort(_draw_by_building(numbers, seed, 1)[:, 0], kind="stable"))
    return ExemplarChoiceOrder(numbers, tuple(others[rank[others] < rank[one]] for one, others in enumerate(near)))


def _draw_by_building(numbers: Int64Array, seed: int, count: int) -> Float64Array:
    """Draw random numbers by (seed, building), (b, count); the first orders the choices."""
    draws = [np.random.default_rng([seed, number]).random(count) for number in numbers.tolist()]
    return np.array(draws).reshape(-1, count)


def _misfit_costs(walls: ExemplarTargetWalls, main: Int64Array, library: ExemplarLibrary) -> Float64Array:
    """Compute the cost of each exemplar for each building by its widest wall, (b, k)."""

    def ratio(own: Float64Array, theirs: Float64Array) -> Float64Array:
        return np.abs(np.log(own[:, None] / theirs[None]))

    floors, given = walls.floors[main].astype(float), np.maximum(np.asarray(library.floors, float), 1)
    misfit = EXEMPLAR_CHOICE.floors_cost * ratio(floors, given)
    misfit += EXEMPLAR_CHOICE.floor_height_cost * ratio(
        walls.height[main] / floors, np.asarray(library.height, float) / given
    )
    if len(walls.style):
        misfit += EXEMPLAR_CHOICE.other_style_cost * library.is_other_style(walls.style[main])
    return np.asarray(misfit + EXEMPLAR_CHOICE.quality_cost * (1 - np.asarray(library.body, float)))


def _is_in_street_families(street: Int64Array, family: Int64Array, seed: int) -> BoolArray:
    """Return whether each exemplar is of the families of each building's street (b,), (b, k).

    A street draws its families in proportion to the number of their exemplars.
    """
    home = np.ones((len(street), len(family)), bool)
    size = np.bincount(family)
    # expected order statistics of exponential draws: families of equal size keep the order of the permutation
    arrival = np.cumsum(1 / np.arange(len(size), 0, -1))
    for number in np.unique(street).tolist():
        order = np.random.default_rng([seed, number]).permutation(len(size))
        kept = order[np.argsort(arrival / size[order], kind="stable")[: EXEMPLAR_CHOICE.families_per_street]]
        home[street == number] = np.isin(family, kept)
    return home


def _neighbouring_buildings(
    ends: Float64Array, row: Int64Array, count: int
) -> tuple[list[Int64Array], list[Float64Array]]:
    """Return the neighbours of each building within `neighbourhood_m`, ascending, and their distances in metres."""
    lines = shapely.linestrings(ends)
    one, other = shapely.STRtree(lines).query(lines, predicate="dwithin", distance=EXEMPLAR_CHOICE.neighbourhood_m)
    apart = row[one] != row[other]
    pairs = np.column_stack([row[one[apart]], row[other[apart]]])
    metres = shapely.distance(lines[one[apart]], lines[other[apart]])
    order = np.lexsort((metres, pairs[:, 1], pairs[:, 0]))
    pairs, metres = pairs[order], metres[order]
    new = np.ones(len(pairs), bool)
    new[1:] = (np.diff(pairs, axis=0) != 0).any(axis=1)
    pairs, metres = pairs[new], metres[new]
    cuts = np.searchsorted(pairs[:, 0], np.arange(1, count))
    return np.split(pairs[:, 1], cuts), np.split(metres, cuts)


def _cheapest_exemplar(misfit: Float64Array, theirs: Int64Array, metres: Float64Array, library: ExemplarLibrary) -> int:
    """Return the cheapest exemplar for a building, given those of its neighbours (-1: none yet) and their distances."""
    cost = misfit.copy()
    has = theirs >= 0
    closeness = 1 - metres[has] / EXEMPLAR_CHOICE.neighbourhood_m
    for exemplar, close in zip(theirs[has].tolist(), closeness.tolist(), strict=True):
        cost[exemplar] = max(cost[exemplar], misfit[exemplar] + EXEMPLAR_CHOICE.same_exemplar_cost * (1 + close))
    if has.any():
        alike = np.exp(-(library.distance[theirs[has]] ** 2)) * closeness[:, None]
        cost += EXEMPLAR_CHOICE.similar_cost * alike.max(axis=0)
        cost += EXEMPLAR_CHOICE.same_form_cost * np.exp(
            -((library.form[theirs[has]] / EXEMPLAR_CHOICE.form_distance) ** 2)
        ).max(axis=0)
    return int(np.argmin(cost))
