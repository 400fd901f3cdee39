"""Objects on the ground stand clear of walls and carriageways, at the height of the ground."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from shapely import LineString, Point

from facade_core.core.street_objects import OBJECT_KINDS, PlacedObjects, object_kind, stated_object_kind
from facade_core.core.types import GroundObject, GroundWay, MappedGround
from facade_core.geometry.charts import ChartBuilder
from facade_core.geometry.ground.ground_charts import add_ground_charts
from facade_core.geometry.ground.layers import join_carriageways
from facade_core.geometry.ground.objects import place_objects, standing_areas
from facade_core.geometry.ground.terrain import Terrain

ROAD = GroundWay("r", LineString([(-50, 0), (50, 0)]), "road", 7.0, "asphalt")
HOUSE = shapely.box(-20, 8, 20, 20)
# a slope of 10 % to the east
SLOPE = Terrain(-60.0, -60.0, 120.0, np.array([[0.0, 12.0], [0.0, 12.0]]))


TRAM = GroundWay("t", LineString([(-50, -10), (50, -10)]), "tram", 1.435, "asphalt")


def place(*objects: GroundObject, ways: tuple[GroundWay, ...] = (ROAD, TRAM)) -> PlacedObjects:
    pieces = ChartBuilder()
    add_ground_charts(pieces, [shapely.box(-50, -30, 50, 30).difference(HOUSE)], SLOPE, 32.0)
    charts, mesh = pieces.build()
    return place_objects(MappedGround(ways, objects=objects), [HOUSE], charts, mesh, np.ones(len(charts), bool))


def test_nothing_stands_in_a_wall_or_on_a_carriageway() -> None:
    rng = np.random.default_rng(1)
    kinds = [kind.name for kind in OBJECT_KINDS if not kind.is_joined]
    places = rng.uniform((-45, -25), (45, 25), (300, 2))
    stated = [GroundObject(f"n{i}", Point(xy), kinds[i % len(kinds)]) for i, xy in enumerate(places)]
    lines = [GroundObject(f"w{k}", LineString([(-30, y), (30, y + 4)]), k) for k, y in (("fence", 1.0), ("hedge", 5.0))]
    placed = place(*stated, *lines)
    areas = standing_areas(placed)
    carriageway, _ = join_carriageways([ROAD])
    assert not shapely.intersects(areas, HOUSE).any()
    assert not shapely.intersects(areas, carriageway).any()
    assert not shapely.intersects(areas, TRAM.line).any()
    assert set(placed.counts()) == {*kinds, "fence", "hedge"}
    trees = np.isin(placed.kind, [0, 1])
    gaps = shapely.distance(shapely.points(placed.position[trees, :2]), HOUSE)
    assert (placed.size[trees, 0] / 2 < gaps).all()
    assert np.abs(SLOPE.interpolate(placed.position[:, :2]) - placed.position[:, 2]).max() < 0.02


def test_an_object_at_an_edge_is_moved_and_one_far_inside_left_out() -> None:
    placed = place(GroundObject("kerb", Point(0, -3.0), "street_lamp"), GroundObject("middle", Point(0, 0.1), "bench"))
    assert placed.id == ("kerb",)
    assert placed.position[0, 1] == pytest.approx(-3.5 - 0.32)
    assert place(GroundObject("inside", Point(0, 14), "tree")).id == ()
    assert place(GroundObject("beyond", Point(200, 0), "tree")).id == ()


def test_stated_sizes_and_directions_are_kept() -> None:
    tall = GroundObject("t", Point(0, -20), "tree", height=14.0, width=5.0)
    bench = GroundObject("b", Point(10, -20), "bench", direction=90.0)
    placed = place(tall, bench, replace(bench, id="c", direction=None))
    assert placed.size[0].tolist() == pytest.approx([5.0, 5.0, 14.0])
    assert placed.heading[1:].tolist() == pytest.approx([90.0, 0.0])  # the road lies to the north


def test_pieces_of_a_hedge_meet() -> None:
    placed = place(GroundObject("h", LineString([(-10, -20), (-1, -20), (-1, -14)]), "hedge"))
    assert placed.size[:, 0].sum() == pytest.approx(15.0)
    assert len(set(placed.id)) == len(placed)


def test_placement_is_by_id_and_not_by_order() -> None:
    stated = [GroundObject(f"n{i}", Point(5 * i, -20), "tree") for i in range(8)]
    one, other = place(*stated), place(*stated[::-1])
    order = [other.id.index(id) for id in one.id]
    assert np.array_equal(one.size, other.size[order])
    assert np.array_equal(one.variant, other.variant[order])


def test_wires_hang_over_the_track_and_end_at_walls() -> None:
    line = LineString([(-40, -10), (40, -10)])
    wire = place(GroundObject("w", line, "tram_wire"))
    assert wire.size[:, 0].sum() == pytest.approx(line.length)
    across = place(GroundObject("w", LineString([(0, -10), (0, 10)]), "tram_wire"))
    assert not shapely.intersects(standing_areas(across), HOUSE).any()
    assert len(across) == 3


def test_plausible_cars_park_along_the_kerb_and_lamps_stand_behind_it() -> None:
    road = replace(ROAD, width=9.0, pavement=(3.0, 3.0), parking=(2.1, 0.0))
    stated = GroundObject("n", Point(-30, 7), "street_lamp")
    likely = [GroundObject("r", road.line, kind, is_stated=False) for kind in ("street_lamp", "parked_car")]
    crossing = GroundWay("c", LineString([(10, -6), (10, 6)]), "crossing", 3.0, "asphalt")
    placed = place(stated, *likely, ways=(road, TRAM, crossing))
    assert placed.counts() == {"street_lamp": 1}
    assert set(placed.plausible_counts()) == {"street_lamp", "parked_car"}
    areas = np.array(standing_areas(placed), object)
    is_car = placed.kind == [kind.name for kind in OBJECT_KINDS].index("parked_car")
    strip = shapely.box(-50, 2.4, 50, 4.5)
    assert shapely.within(areas[is_car], strip).all()
    assert not shapely.intersects(areas[is_car], crossing.line).any()
    assert not shapely.intersects(areas, HOUSE.buffer(1.3)).any()
    assert placed.heading[is_car] == pytest.approx(270.0), "on the left of the road its own side drives west"
    lamps = placed.position[~is_car, :2]
    assert min(np.hypot(*(a - b)) for i, a in enumerate(lamps) for b in lamps[:i]) > 25
    assert not shapely.intersects(areas[~is_car], road.line.buffer(4.5)).any()


def test_tags_name_kinds() -> None:
    assert stated_object_kind({"natural": "tree", "leaf_type": "needleleaved"}) is object_kind("conifer")
    assert stated_object_kind({"natural": "tree_row"}) is object_kind("tree")
    assert stated_object_kind({"natural": "wood"}) is None
    assert stated_object_kind({"railway": "tram"}) is None
    assert stated_object_kind({"railway": "tram", "electrified": "contact_line"}) is object_kind("tram_wire")
