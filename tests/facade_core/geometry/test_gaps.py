"""Streets derived from the gaps between buildings, on plans whose streets are known."""

from __future__ import annotations

import json
import random
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import shapely
from shapely import Polygon, box

from facade_core.core.errors import GeometryError
from facade_core.core.types import Street
from facade_core.geometry.ground.settings import GAPS
from facade_core.geometry.ground.street_gaps import derive_streets

TERRACES = [box(6 * i, y, 6 * i + 6, y + 10) for i in range(10) for y in (0, 22)]


def lines_of(footprints: Sequence[Polygon], **options: float) -> np.ndarray:
    streets = derive_streets(footprints, **options)
    assert [street.id for street in streets] == [f"g{index}" for index in range(len(streets))]
    lines = np.array([street.line for street in streets], dtype=object)
    assert all(street.name is None and street.line.is_simple for street in streets)
    if len(lines):
        assert shapely.distance(shapely.union_all(footprints), shapely.union_all(lines)) >= GAPS.min_clearance_m
    return lines


def test_between_two_terraces_runs_one_street_in_the_middle_and_a_ring_around() -> None:
    ring, middle = sorted(lines_of(TERRACES), key=lambda line: -line.length)
    assert ring.is_closed
    assert shapely.is_ccw(ring)
    assert middle.length == pytest.approx(60 + 15, abs=5)
    assert middle.coords[0][0] < middle.coords[-1][0]
    between = shapely.get_coordinates(middle.intersection(box(3, 0, 57, 40)))
    np.testing.assert_allclose(between[:, 1], 16.0, atol=0.3)
    facade = ring.intersection(box(10, -20, 50, 0))
    np.testing.assert_allclose(shapely.get_coordinates(facade)[:, 1], -7.5, atol=0.3)


def test_streets_go_on_through_a_crossing() -> None:
    blocks = [box(0, 0, 40, 40), box(52, 0, 92, 40), box(0, 52, 40, 92), box(54, 50, 92, 92)]
    across = [line for line in lines_of(blocks) if not line.is_closed]
    assert len(across) == 2, "two streets that cross a little askew, not four that meet"
    assert all(95 < line.length < 115 for line in across)
    assert across[0].crosses(across[1])


def test_a_building_alone_has_a_ring_around_it() -> None:
    (ring,) = lines_of([box(0, 0, 20, 12)])
    assert ring.is_closed
    assert Polygon(ring).contains(box(0, 0, 20, 12))
    assert shapely.hausdorff_distance(ring, box(0, 0, 20, 12).buffer(7.5).exterior) < 1.5


@pytest.mark.parametrize(("gap", "shared"), [(60.0, False), (24.0, True)])
def test_only_buildings_far_apart_have_a_ring_each(gap: float, shared: bool) -> None:
    lines = lines_of([box(0, 0, 20, 30), box(20 + gap, 0, 40 + gap, 30)])
    assert (sum(line.is_closed for line in lines) == len(lines) == 2) != shared
    middle = shapely.LineString([(20 + gap / 2 - 1, 15), (20 + gap / 2 + 1, 15)])
    assert any(line.intersects(middle) for line in lines) == shared


def test_a_gap_is_a_street_where_a_camera_fits_through() -> None:
    for gap, streets in ((2.0, 0), (3.0, 1)):
        lines = lines_of([box(0, 0, 40, 30), box(40 + gap, 0, 80, 30)])
        assert sum(line.intersects(box(40, 10, 40 + gap, 20)) for line in lines) == streets


def test_yards_are_no_streets_but_what_a_gate_opens_is() -> None:
    closed = box(0, 0, 60, 60).difference(box(10, 10, 50, 50))
    gated = closed.difference(box(0, 28, 12, 32))
    assert not shapely.union_all(lines_of([closed])).intersects(box(10, 10, 50, 50))
    assert shapely.union_all(lines_of([gated])).intersection(box(10, 10, 50, 50)).length > 10


def test_a_large_place_without_an_entrance_is_still_a_street() -> None:
    side = np.sqrt(GAPS.min_square_m2) + 10
    walls = box(0, 0, side + 20, side + 20).difference(box(10, 10, side + 10, side + 10))
    assert any(box(10, 10, side + 10, side + 10).contains(line) for line in lines_of([walls]))


def test_no_spurs_lead_into_corners_but_blind_alleys_do_lead_on() -> None:
    alley = [box(0, 0, 30, 10), box(0, 16, 30, 26), box(28, 0, 60, 26)]
    ring, blind = sorted(lines_of(alley), key=lambda line: -line.length)
    assert ring.is_closed
    assert blind.bounds[2] == pytest.approx(28 - 3, abs=1), "it ends where its two corners are equally near"
    notched = box(0, 0, 60, 20).difference(box(20, 18, 24, 20)).difference(box(40, 19, 40.5, 20))
    assert len(lines_of([notched])) == 1


def test_touching_and_overlapping_buildings_are_one() -> None:
    tidy = lines_of([box(0, 0, 40, 10)])
    messy = lines_of([box(0, 0, 10.2, 10), box(10, 0, 20, 10), box(20.001, 0, 30, 10), box(29.5, 0, 40, 10)])
    assert len(messy) == len(tidy) == 1
    assert shapely.hausdorff_distance(tidy[0], messy[0]) < 0.5


def test_order_of_footprints_and_place_on_earth_do_not_matter() -> None:
    shuffled = list(TERRACES)
    random.Random(3).shuffle(shuffled)
    assert derive_streets(shuffled) == derive_streets(TERRACES)
    shift = np.array([385_000.0, 6_671_000.0])
    moved = derive_streets([shapely.transform(footprint, lambda xy: xy + shift) for footprint in TERRACES])
    for here, there in zip(derive_streets(TERRACES), moved, strict=True):
        back = shapely.transform(there.line, lambda xy: xy - shift)
        assert shapely.equals_exact(here.line, back, tolerance=2e-3)


def test_a_long_street_is_one_line_across_tiles() -> None:
    (ring,) = lines_of([box(0, 0, 2000, 10)])
    assert ring.is_closed
    assert ring.length == pytest.approx(2 * 2010 + 2 * np.pi * 7.5, abs=10)


def test_wider_reach_stands_farther_off() -> None:
    (ring,) = lines_of([box(0, 0, 20, 12)], reach=24.0)
    assert ring.bounds[0] == pytest.approx(-12, abs=0.6)


def test_nothing_and_what_cannot_be_used() -> None:
    assert derive_streets([]) == ()
    assert derive_streets([Polygon()]) == ()
    with np.errstate(invalid="ignore"):
        broken = Polygon([(0, 0), (1, 0), (1, np.nan)])
    with pytest.raises(GeometryError, match=r"footprint 2 .*not finite"):
        derive_streets([Polygon(), box(0, 0, 9, 9), broken])
    with pytest.raises(GeometryError, match=r"reach 2 m"):
        derive_streets([box(0, 0, 9, 9)], reach=2.0)


@pytest.fixture(scope="module")
def delfshaven(data: Path) -> list[Polygon]:
    """Ground surfaces of the 853 buildings of a dense quarter of terraces."""
    city = json.loads((data / "city/delfshaven/3-20-DELFSHAVEN.city.json").read_text())
    at = np.array(city["vertices"]) * city["transform"]["scale"] + city["transform"]["translate"]
    footprints = []
    for thing in city["CityObjects"].values():
        for geometry in thing["geometry"]:
            kinds = [surface["type"] for surface in geometry["semantics"]["surfaces"]]
            ground = [
                Polygon(at[rings[0]][:, :2], [at[hole][:, :2] for hole in rings[1:]])
                for rings, kind in zip(geometry["boundaries"], geometry["semantics"]["values"], strict=True)
                if kind is not None and kinds[kind] == "GroundSurface"
            ]
            union = shapely.union_all(shapely.make_valid(np.array(ground, dtype=object)))
            footprints += [part for part in shapely.get_parts(union) if part.geom_type == "Polygon" and part.area > 10]
    return footprints


def test_real_terraces_have_streets_along_their_fronts(delfshaven: list[Polygon]) -> None:
    streets: tuple[Street, ...] = derive_streets(delfshaven)
    length = sum(street.line.length for street in streets)
    lines = shapely.union_all([street.line for street in streets])
    built = shapely.union_all(delfshaven)
    assert len(delfshaven) > 700
    assert 10_000 < length < 16_000
    assert built.distance(lines) >= GAPS.min_clearance_m
    # Whatever lies 8 m in front of a building, and not in a yard, has a street within 30 m.
    open_ground = built.buffer(8).difference(shapely.union_all([Polygon(p.exterior) for p in built.buffer(1.3).geoms]))
    assert open_ground.difference(lines.buffer(30)).area < 0.01 * open_ground.area
