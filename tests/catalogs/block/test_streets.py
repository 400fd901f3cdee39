"""Centrelines into streets: what is broken is set aside with its reason, the rest is kept."""

from __future__ import annotations

import random
from dataclasses import replace

import numpy as np
import pytest
import shapely
from pyproj import CRS
from shapely import LineString, Point, box

from catalogs.block.streets import build_block_streets
from catalogs.features import Centreline, CentrelinesAndGround, Fault

UTM = CRS.from_epsg(32635)
X, Y = 385_000.0, 6_671_000.0
AREA = box(X, Y, X + 100, Y + 100)


def piece(id: str, *points: tuple[float, float], name: str | None = None) -> Centreline:
    with np.errstate(invalid="ignore"):
        return Centreline(id, LineString([(X + x, Y + y) for x, y in points]), name)


GOOD = piece("w1", (0, 10), (90, 10), name="High Street")
BROKEN = (
    piece("w2", (20, 20), (20, 20)),
    piece("w3", (20, 30), (np.nan, 30)),
    piece("w4", (20, 40), (20.4, 40), name="Short"),
    Centreline("w5", LineString(), None),
)


def test_broken_lines_are_faults_with_a_reason_and_the_rest_stays() -> None:
    streets, faults = build_block_streets(CentrelinesAndGround("EPSG:32635", (*BROKEN, GOOD)), UTM, area=None)
    assert [(street.id, street.name) for street in streets] == [("s1", "High Street")]
    assert [fault.id for fault in faults] == ["w2", "w3", "w4", "w5"]
    assert {fault.kind for fault in faults} == {"street"}
    expected = ("has no length", "no finite numbers", "is 0.4 m long", "has no coordinates")
    for fault, words, broken in zip(faults, expected, BROKEN, strict=True):
        assert words in fault.reason
        assert "; remove it" in fault.reason
        assert "\n" not in fault.reason
        assert fault.place is broken.line


def test_crumbs_of_clipping_are_no_faults() -> None:
    crossing = piece("w6", (-50, 99.9), (0.3, 99.9), name="Crumb")
    streets, faults = build_block_streets(CentrelinesAndGround("EPSG:32635", (GOOD, crossing)), UTM, area=AREA)
    assert [street.id for street in streets] == ["s1"]
    assert faults == ()


def test_short_pieces_of_a_longer_street_are_no_faults() -> None:
    parts = (piece("w7", (0, 0), (0.5, 0), name="Lane"), piece("w8", (0.5, 0), (30, 0), name="Lane"))
    streets, faults = build_block_streets(CentrelinesAndGround("EPSG:32635", parts), UTM, area=None)
    assert [(street.id, street.line.length) for street in streets] == [("s7", 30.0)]
    assert faults == ()


def test_faults_outside_the_area_are_left_out() -> None:
    far = tuple(
        Centreline(f"w1{k}", shapely.transform(p.line, lambda xy: xy + 500), p.name) for k, p in enumerate(BROKEN[:3])
    )
    stated = (
        Fault("w20", "street", "near", Point(X + 5, Y + 5)),
        Fault("w21", "street", "far", Point(X - 5, Y + 5)),
        Fault("w22", "street", "nowhere"),
    )
    source = CentrelinesAndGround("EPSG:32635", (GOOD, *BROKEN, *far), stated)
    assert [f.id for f in build_block_streets(source, UTM, area=AREA)[1]] == ["w2", "w3", "w4", "w5", "w20", "w22"]
    assert len(build_block_streets(source, UTM, area=None)[1]) == 10


def test_order_of_the_pieces_does_not_matter() -> None:
    items = [GOOD, *BROKEN, piece("w9", (90, 10), (95, 50), name="High Street")]
    expected = build_block_streets(CentrelinesAndGround("EPSG:32635", tuple(items)), UTM, area=AREA)
    random.Random(2).shuffle(items)
    assert repr(build_block_streets(CentrelinesAndGround("EPSG:32635", tuple(items)), UTM, area=AREA)) == repr(expected)


def test_a_source_without_a_frame_is_in_the_blocks() -> None:
    assert build_block_streets(CentrelinesAndGround(None, (GOOD,)), UTM, area=AREA)[0][0].line.equals(GOOD.line)
    assert build_block_streets(CentrelinesAndGround(None, ()), UTM, area=AREA) == ((), ())


def test_what_the_frame_cannot_hold_is_a_fault() -> None:
    lost = replace(GOOD, line=LineString([(25.0, 60.0), (25.0, 2000.0)]))
    streets, faults = build_block_streets(CentrelinesAndGround("EPSG:4326", (lost,)), UTM, area=None)
    assert streets == ()
    assert "the block's frame cannot hold" in faults[0].reason


@pytest.mark.parametrize("name", [None, ""])
def test_nameless_streets_stay_nameless(name: str | None) -> None:
    streets, _ = build_block_streets(CentrelinesAndGround(None, (replace(GOOD, name=name),)), UTM, area=None)
    assert streets[0].name is None


def test_pieces_of_a_clipped_street_take_no_id_of_another() -> None:
    """Three pieces of one way within the area, and another way with the id that the second would have."""
    bends = [(10, 10), (10, 200), (30, 200), (30, 10), (50, 10), (50, 200), (70, 200), (70, 10)]
    pieces = (piece("5", *bends, name="Bends"), piece("5-1", (5, 50), (95, 50), name="Across"))
    streets, _ = build_block_streets(CentrelinesAndGround("EPSG:32635", pieces), UTM, area=AREA)
    ids = [street.id for street in streets]
    assert len(ids) == len(set(ids)) == 4
    assert next(street.id for street in streets if street.name == "Across") == "s5-1"
