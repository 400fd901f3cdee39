"""Parts of buildings stand in place of what they cover, on what is below them."""

from __future__ import annotations

import shapely
from pyproj import CRS
from shapely import Polygon

from catalogs.buildings.assembly import BlockBuildings, assemble_buildings
from catalogs.features import Footprint, Footprints
from facade_core.core.types import Building, BuildingFinish

STOREY = 3.0
ALL = shapely.box(0, 0, 40, 20)


def part(id: str, outline: Polygon, **stated: float | None) -> Footprint:
    values = {"height": None, "levels": None} | stated
    return Footprint(id, outline, values.pop("height"), values.pop("levels"), None, is_part=True, **values)  # type: ignore[arg-type]


def whole(height: float | None = None, levels: float | None = None, outline: Polygon = ALL) -> Footprint:
    return Footprint("w", outline, height, levels, "Hall", finish=BuildingFinish(wall_colour=(1, 2, 3)))


def block(*items: Footprint) -> BlockBuildings:
    return assemble_buildings([Footprints("EPSG:32635", items)], CRS("EPSG:32635"), area=None, floor_height=STOREY)


def by_id(*items: Footprint) -> dict[str, Building]:
    return {building.id: building for building in block(*items).items}


def test_what_no_part_covers_stays_as_the_building() -> None:
    found = by_id(whole(12.0), part("p", shapely.box(0, 0, 25, 20), height=30.0))
    assert found["w"].footprint.equals(shapely.box(25, 0, 40, 20))
    assert (found["p"].part_of, found["p"].raised, found["p"].name) == ("w", 0.0, "Hall")
    assert found["p"].finish.wall_colour == (1, 2, 3)
    assert found["w"].part_of is None


def test_a_tower_begins_at_the_roof_of_the_podium_that_it_stands_in() -> None:
    tower = shapely.box(10, 5, 20, 15)
    for low in ({}, {"min_level": 2.0}):
        found = by_id(whole(), part("podium", ALL, levels=2.0), part("tower", tower, levels=9.0, **low))
        assert set(found) == {"podium", "tower"}
        assert (found["tower"].raised, found["tower"].height) == (6.0, 27.0)
        assert found["podium"].roof is not None
        assert found["podium"].roof.shape == "flat", "something stands on it"


def test_an_outline_that_ends_below_a_raised_part_stays_there() -> None:
    upper = shapely.box(0, 0, 40, 12)
    stays = by_id(whole(levels=2.0), part("p", upper, levels=7.0, min_level=2.0))
    assert stays["w"].footprint.equals(ALL)
    assert (stays["p"].raised, stays["p"].levels) == (6.0, 5)
    unknown = by_id(whole(), part("p", upper, levels=7.0, min_level=2.0))
    assert unknown["w"].height == 6.0
    assert unknown["w"].height_source == "default"


def test_a_passage_stays_open_and_what_lies_all_in_a_building_goes_down_to_it() -> None:
    passage = part("p", shapely.box(10, 0, 16, 20), height=18.0, min_height=4.0)
    found = by_id(whole(18.0), passage)
    assert {"w-0", "w-1", "p"} == set(found)
    assert block(whole(), passage).notes == ("2 of 3 buildings state no height: 12 m assumed, since none is known",)
    assert found["w-0"].part_of == found["w-1"].part_of == "w"
    assert found["p"].raised == 4.0
    lantern = part("p", shapely.box(10, 5, 16, 15), height=20.0, min_height=16.0)
    assert by_id(whole(9.0), lantern)["p"].raised == 9.0


def test_what_is_no_part_is_told() -> None:
    items = [
        whole(12.0),
        part("low", shapely.box(0, 0, 9, 9), height=5.0, min_height=8.0),
        part("small", shapely.box(0, 0, 1, 1), height=5.0),
        part("inside", shapely.box(20, 5, 30, 15), height=5.0),
        part("around", shapely.box(15, 0, 40, 20), height=9.0),
        part("alone", shapely.box(100, 0, 120, 20), height=9.0),
    ]
    found = block(*items)
    assert {building.id for building in found.items} == {"w", "around", "alone"}
    said = " ".join(found.notes)
    for id, reason in (("low", "end no higher"), ("small", "under 4 m2"), ("inside", "inside of others")):
        assert reason in said
        assert id in said


def test_a_building_without_parts_is_as_it_was() -> None:
    alone = Footprint("b", shapely.box(60, 0, 75, 12), None, None, None)
    hall = whole(levels=5.0)
    before = by_id(hall, alone)["b"]
    after = by_id(hall, alone, part("p", shapely.box(0, 0, 20, 20), levels=9.0))["b"]
    assert (before.height, before.roof) == (after.height, after.roof)
