"""Exemplars of facades: a building keeps its choice until its own walls change or the exemplar is gone.

The choices are stored with the block. They depend on the runs before, so a fresh run may choose others.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np
import shapely

from catalogs.block.part import CityPart
from catalogs.block.reader import Block
from facade_core.atlas.journal import read_journal
from facade_core.atlas.store import BRANCH, commit, open_repository, open_root, open_root_of_any_format
from facade_core.atlas.stored_files import EXEMPLARS
from facade_core.core.arrays import Int64Array
from facade_core.core.facade_styles import facade_style_number
from facade_core.core.name_hash import hash_name
from facade_core.core.types import Building, Street
from facade_core.core.zarr_types import StoreGroup, get_subgroup
from facade_core.facade.exemplar_quality import ExemplarQuality
from facade_core.plan.exemplar_choice import ExemplarTargetWalls, choose_exemplars, choose_ground_floors
from facade_core.plan.exemplar_inputs import facade_style_numbers, target_walls_from_outlines
from facade_core.plan.exemplar_style import ExemplarLibrary
from facade_core.plan.kept_choices import Wall, keeps_choice, walls_by_building
from facade_core.plan.plan import Plan
from tasks.engine.inputs import split_key
from tasks.engine.run import Run
from tasks.stages.exemplars.record import ExemplarRecord
from tasks.stages.facades.imagery import ChosenExemplar

# A shop is behind the nearest wall, at most so far, metres: maps put it into the building or before it.
MAX_SHOP_DISTANCE_M = 15.0
# Where a wall begins and ends at its foot, as shares of its chart.
FOOT_CORNERS = np.array([[0.0, 1.0], [1.0, 1.0]])
# Attribute of the store's group of exemplars that holds the choices.
CHOICES = "choices"


# A stored choice as JSON has it.
_Row = tuple[int, list[list[float]], str, str, str | None]


class StoredChoice(NamedTuple):
    """Choice of a building.

    Attributes
    ----------
    building : hash of its id.
    walls : its walls.
    exemplar : name of its exemplar.
    picture : digest of the exemplar's picture.
    ground_floor : name of the exemplar whose ground floor it shows, None for its own, empty where none shows one well.
    """

    building: int
    walls: tuple[Wall, ...]
    exemplar: str
    picture: str
    ground_floor: str | None


def choose_facade_exemplars(
    run: Run, block: Block, plan: Plan, group: StoreGroup
) -> tuple[dict[int, ChosenExemplar], Set[int]]:
    """Return the exemplar of each facade, empty if the block takes none, and the facades with a corrected one."""
    if run.texture.walls != "exemplar":
        return {}, set()
    records = read_journal(group, "exemplars", ExemplarRecord)
    of_building, _ = _choose(run, block, plan, group)
    chosen = {i: of_building[number] for i, number in enumerate(plan.facades.house.tolist()) if of_building}
    stated = _corrected_exemplars(plan, block, records, run.seed) if chosen else {}
    return chosen | stated, stated.keys()


def store_exemplar_choices(run: Run, block: Block, plan: Plan) -> None:
    """Store the choices of all buildings in one commit, once all exemplars are prepared."""
    if run.texture.walls != "exemplar":
        return
    session = open_repository(run.store).writable_session(BRANCH)
    group = open_root(session)
    _, choices = _choose(run, block, plan, group)
    if choices != read_choices(group):
        get_subgroup(group, EXEMPLARS).attrs[CHOICES] = choices
        commit(session, "choices of exemplars")


def delete_exemplar_choices(run: Run) -> None:
    """Let all buildings choose again at the next run, which also publishes again."""
    if not run.store.is_dir():
        return
    session = open_repository(run.store).writable_session(BRANCH)
    group = open_root_of_any_format(session)
    if EXEMPLARS not in group:  # nothing is ingested yet
        return
    get_subgroup(group, EXEMPLARS).attrs[CHOICES] = []
    group.attrs["published_by"] = ""
    commit(session, "restyle")


def read_choices(group: StoreGroup) -> list[StoredChoice]:
    """Read the stored choices; of one building the latest comes last."""
    rows = cast(list[_Row], get_subgroup(group, EXEMPLARS).attrs.get(CHOICES, []))
    return [
        StoredChoice(building, tuple(Wall(w, h, int(f), bool(s)) for w, h, f, s in walls), exemplar, picture, ground)
        for building, walls, exemplar, picture, ground in rows
    ]


def _choose(
    run: Run, block: Block, plan: Plan, group: StoreGroup
) -> tuple[dict[int, ChosenExemplar], list[StoredChoice]]:
    """Return the exemplar of each building, empty if none could be prepared, and the choices to store."""
    records, stored = read_journal(group, "exemplars", ExemplarRecord), read_choices(group)
    if not len(plan.facades):
        return {}, stored
    walls = exemplar_choice_walls(plan, block, facade_shops(plan, block))
    return choose_building_exemplars(walls, records, stored, seed=run.seed)


def choose_building_exemplars(
    walls: ExemplarTargetWalls, records: Sequence[ExemplarRecord | None], stored: Sequence[StoredChoice], *, seed: int
) -> tuple[dict[int, ChosenExemplar], list[StoredChoice]]:
    """Choose an exemplar for each building that keeps none, given those that are kept.

    Pictures do not count: a photo that comes, goes or is rejected changes its own facade and the colour of its building, but no
    exemplar.

    Parameters
    ----------
    walls : walls of the buildings.
    records : records of the exemplars.
    stored : choices of earlier runs; a building whose walls are as they were before a change takes its choice of then.
    seed : random seed.

    Returns
    -------
    chosen : exemplar by building; empty if none could be prepared.
    choices : choices to store.
    """
    usable, library = usable_exemplars(records)
    if not usable:
        return {}, list(stored)
    pictures = [split_key(one.key).get("picture", "") for one in usable]
    index: dict[str | tuple[str, str], int] = {}
    for i, (one, picture) in enumerate(zip(usable, pictures, strict=True)):
        index.setdefault(one.name, i)
        index[one.name, picture] = i
    own = walls_by_building(walls)
    kept: dict[int, StoredChoice] = {}
    for choice in stored:
        if choice.exemplar in index and keeps_choice(own.get(choice.building, ()), choice.walls):
            kept[choice.building] = choice

    def find(choice: StoredChoice) -> int:
        return index.get((choice.exemplar, choice.picture), index[choice.exemplar])

    buildings = walls.building.tolist()
    given = np.array([find(kept[number]) if number in kept else -1 for number in buildings], np.int64)
    exemplars = choose_exemplars(walls, library, seed=seed, kept=given)
    found = dict(zip(buildings, exemplars.tolist(), strict=True))
    grounds = choose_ground_floors(
        library, exemplars, building=walls.building, width=walls.width, shops=walls.shops, seed=seed
    )
    chosen = _exchange_ground_floors(usable, buildings, exemplars, grounds)
    for number, choice in kept.items():
        if choice.picture == pictures[found[number]]:  # else the ground floor of another picture
            chosen[number] = _with_ground_floor(chosen[number], choice.ground_floor, usable)
    now = []
    for number, one in sorted(chosen.items()):
        before = kept[number].walls if number in kept else own[number]
        now.append(StoredChoice(number, before, one.name, pictures[found[number]], _ground_floor_name(one)))
    replaced = {(choice.building, choice.walls) for choice in now}
    return chosen, [*(choice for choice in stored if (choice.building, choice.walls) not in replaced), *now]


def _exchange_ground_floors(
    usable: Sequence[ChosenExemplar], keys: Sequence[int], own: Int64Array, ground: Int64Array
) -> dict[int, ChosenExemplar]:
    """Return exemplars (n,) by key, each with the ground floor of another, or a plain one for -1."""
    return {
        key: usable[i] if i == other else replace(usable[i], ground_floor=usable[other] if other >= 0 else "plain")
        for key, i, other in zip(keys, own.tolist(), ground.tolist(), strict=True)
    }


def _with_ground_floor(one: ChosenExemplar, name: str | None, usable: Sequence[ChosenExemplar]) -> ChosenExemplar:
    """Return an exemplar with the ground floor of a stored choice, unchanged if that is gone."""
    if name is None:
        return replace(one, ground_floor=None)
    if not name:
        return replace(one, ground_floor="plain")
    others = [other for other in usable if other.name == name]
    return replace(one, ground_floor=others[0]) if others else one


def _ground_floor_name(one: ChosenExemplar) -> str | None:
    other = one.ground_floor
    return other.name if isinstance(other, ChosenExemplar) else other and ""


def facade_shops(plan: Plan, block: Block) -> Int64Array:
    """Return for each facade of a block or part of a city whether a map has a shop at its building."""
    return facade_shop_flags(plan, block.shops) if block.part is None else _shops_of_part(plan, block.part)


def _corrected_exemplars(
    plan: Plan, block: Block, records: Sequence[ExemplarRecord | None], seed: int
) -> dict[int, ChosenExemplar]:
    """Return the exemplars that corrections name for the buildings of facades, if they could be prepared."""
    usable, library = usable_exemplars(records)
    index = {one.name: i for i, one in enumerate(usable)}
    names = [block.corrections.value_correction(plan.scene.names[one], "exemplar") for one in plan.facades.building]
    facades = np.array([facade for facade, name in enumerate(names) if name in index], np.int64)
    own = np.array([index[str(names[facade])] for facade in facades], np.int64)
    grounds = choose_ground_floors(
        library,
        own,
        building=plan.facades.house[facades],
        width=np.where(plan.facades.seen[facades] > 0, plan.facades.width[facades], np.inf),
        shops=facade_shops(plan, block)[facades],
        seed=seed,
    )
    return _exchange_ground_floors(usable, facades.tolist(), own, grounds)


def facade_shop_flags(plan: Plan, places: Sequence[tuple[float, float]] | None) -> Int64Array:
    """Return for each facade whether a map has a shop at its building.

    Returns
    -------
    shops : (n,) int64: 1 with a shop, 0 without, -1 without a map.
    """
    facades = plan.facades
    if places is None or not len(facades):
        return np.full(len(facades), -1)
    walls = shapely.linestrings(plan.scene.charts.points_at_shares(facades.chart, FOOT_CORNERS)[..., :2])
    _, wall = shapely.STRtree(walls).query_nearest(
        shapely.points(np.array(places).reshape(-1, 2)), max_distance=MAX_SHOP_DISTANCE_M
    )
    return np.isin(facades.building, facades.building[wall]).astype(np.int64)


def _shops_of_part(plan: Plan, part: CityPart) -> Int64Array:
    """Return the same for a part of a city, whose shops are listed by building."""
    told = dict(zip(part.buildings, part.shop_flags, strict=False))
    return np.array([told[plan.scene.names[building]] for building in plan.facades.building.tolist()], np.int64)


def exemplar_choice_walls(plan: Plan, block: Block, shops: Int64Array) -> ExemplarTargetWalls:
    """Return the walls by which exemplars are chosen.

    They are the facades of the block; of a part of a city the outlines of all buildings on which the choice depends.
    """
    if block.part is not None:
        own = set(block.part.buildings)
        buildings = [*(building for building in block.buildings if building.id in own), *block.part.distant_buildings]
        return target_walls_from_outlines(buildings, block.part.front_streets, block.part.shop_flags, block.storey)
    facades = plan.facades
    # Neighbours are found by the walls at streets; for a building that no street sees, by all its walls.
    seen = facades.seen > 0
    told = np.flatnonzero(seen | ~np.isin(facades.house, facades.house[seen]))
    return ExemplarTargetWalls(
        facades.width[told],
        facades.height[told],
        facades.floors[told],
        facades.house[told],
        _street_numbers(plan.streets)[facades.street[told]],
        plan.scene.charts.points_at_shares(facades.chart[told], FOOT_CORNERS)[..., :2],
        shops[told],
        facade_style_numbers(_buildings_by_row(plan, block))[facades.building[told]],
    )


def _buildings_by_row(plan: Plan, block: Block) -> list[Building]:
    """Return the buildings of a block in the order of its plan."""
    of_id = {building.id: building for building in block.buildings}
    return [of_id[name] for name in plan.scene.names]


def usable_exemplars(records: Sequence[ExemplarRecord | None]) -> tuple[list[ChosenExemplar], ExemplarLibrary]:
    """Return the exemplars that could be prepared, and the library of them."""
    done = [(index, record) for index, record in enumerate(records) if record and record["status"] == "done"]
    library = exemplar_library([record for _, record in done])
    return [ChosenExemplar(index, record["unit"], record["key"]) for index, record in done], library


def exemplar_library(records: Sequence[ExemplarRecord]) -> ExemplarLibrary:
    """Return the exemplars of records as the library to choose from."""
    parts = [ExemplarQuality(**record["quality_parts"]) for record in records]
    return ExemplarLibrary(
        [record["height_m"] for record in records],
        [record["floors"] for record in records],
        [record["shop_width"] for record in records],
        [record.get("front_m", 0.0) for record in records],
        # where no facade was found in a picture all of it is a guess
        [
            quality.body if record.get("cut_found", True) else 0.0
            for quality, record in zip(parts, records, strict=True)
        ],
        [quality.ground_floor for quality in parts],
        [record["look"] for record in records],
        [facade_style_number(record.get("style")) for record in records],
    )


def _street_numbers(streets: Sequence[Street]) -> Int64Array:
    """Return a number for each street, (streets,) int64, by its name or id: equal for all parts of a street."""
    return np.array([hash_name(street.name or street.id) for street in streets], np.int64)
