"""A city is cut so that every building and every segment of a street is of one block, and a cut is a function of place."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import shapely
from shapely import LineString

from catalogs.block.segments import MIN_SEGMENT_LENGTH_M, split_streets_at_junctions
from catalogs.city.keys import validate_city_settings
from catalogs.city.partition import MIN_HALO_M, halo_radius, partition_city
from facade_core.core.types import Building, Street

# Streets every 100 m both ways, two buildings between them: one at either side of the middle of what they enclose.
STREETS = tuple(
    Street(f"{way}{number}", f"{way}{number}", LineString([turned(way, 100 * step, 100 * number) for step in range(7)]))
    for turned in (lambda way, along, across: (along, across) if way == "e" else (across, along),)
    for way in "en"
    for number in range(7)
)
BUILDINGS = tuple(
    Building(f"b{row}-{column}-{side}", shapely.box(x, y, x + 30, y + 80), 12.0, "height")
    for row in range(6)
    for column in range(6)
    for side in range(2)
    for x, y in [(100 * column + 10 + 50 * side, 100 * row + 10)]
)


def test_segments_are_all_of_their_street_and_end_at_junctions() -> None:
    cut = split_streets_at_junctions(STREETS)
    assert sum(one.line.length for one in cut) == pytest.approx(sum(one.line.length for one in STREETS))
    assert all(one.line.length >= MIN_SEGMENT_LENGTH_M for one in cut)
    assert len(cut) == len({one.id for one in cut}) == 14 * 6
    (alone,) = split_streets_at_junctions([Street("a", None, LineString([(0, 0), (100, 0), (200, 0)]))])
    assert alone.id == "a", "no street meets it"


@pytest.mark.parametrize("metres", [100, 170, 300, 5000])
def test_everything_is_of_one_block(metres: float) -> None:
    lines = split_streets_at_junctions(STREETS)
    cuts = partition_city(BUILDINGS, lines, block_size=metres, halo=MIN_HALO_M)
    assert sorted(one for cut in cuts for one in cut.buildings) == sorted(one.id for one in BUILDINGS)
    assert sorted(one for cut in cuts for one in cut.streets) == sorted(one.id for one in lines)
    # streets enclose pairs of buildings, which no cut parts
    where = {one: cut.name for cut in cuts for one in cut.buildings}
    assert all(where[one] == where[one[:-1] + "1"] for one in where if one.endswith("-0"))


def test_context_is_all_within_reach_and_nothing_of_its_own() -> None:
    lines = split_streets_at_junctions(STREETS)
    of = {one.id: one.footprint for one in BUILDINGS} | {one.id: one.line for one in lines}
    for cut in partition_city(BUILDINGS, lines, block_size=200, halo=60):
        own = shapely.union_all([of[one] for one in (*cut.buildings, *cut.streets)])
        assert {one.id for one in BUILDINGS if own.distance(one.footprint) <= 60} - set(cut.buildings) == set(
            cut.halo_buildings
        )
        assert {one.id for one in lines if own.distance(one.line) <= 60} - set(cut.streets) == set(cut.halo_streets)


def test_a_building_more_changes_the_blocks_around_it_alone() -> None:
    lines = split_streets_at_junctions(STREETS)
    before = {cut.name: cut for cut in partition_city(BUILDINGS, lines, block_size=100, halo=60)}
    more = replace(BUILDINGS[0], id="new", footprint=shapely.box(45, 45, 55, 55))
    after = {cut.name: cut for cut in partition_city([*BUILDINGS, more], lines, block_size=100, halo=60)}
    changed = {name for name in before if before[name] != after[name]}
    assert changed == {"x0y0", "x1y0", "x0y1"}


def test_parts_of_a_house_are_of_one_block() -> None:
    parts = [replace(one, part_of="house") for one in BUILDINGS[:4]]
    lines = split_streets_at_junctions(STREETS)
    cuts = partition_city([*parts, *BUILDINGS[4:]], lines, block_size=100, halo=60)
    (whole,) = [cut for cut in cuts if parts[0].id in cut.buildings]
    assert {one.id for one in parts} <= set(whole.buildings)


def test_context_reaches_as_far_as_what_is_asked_for_reads() -> None:
    plain = halo_radius(sun=False, panoramas=False, visibility_range=40.0)
    assert plain == MIN_HALO_M < halo_radius(sun=True, panoramas=False, visibility_range=40.0)
    assert halo_radius(sun=False, panoramas=False, visibility_range=200.0) > 400


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"name": "a", "buildings": {"path": "b"}}, "streets: missing.*streetloom run"),
        (
            {"name": "a", "buildings": {"path": "b"}, "streets": {"path": "s"}, "cut": {"meters": 3}},
            "cut.meters: unknown key; did you mean cut.metres?",
        ),
        ({"name": "a", "buildings": {"path": "b"}, "streets": {"path": "s"}, "cut": {"metres": 3}}, "20 to 20000"),
        ({"name": "a", "buildings": {"path": "b"}, "streets": {"path": "s"}, "part": {}}, "part: "),
        ({"blocks": {"path": "b"}, "seed": 3}, "blocks: a folder"),
    ],
)
def test_what_is_wrong_with_a_city_file_is_said_in_a_line(values: dict, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        validate_city_settings(values, Path("city.yaml"))
