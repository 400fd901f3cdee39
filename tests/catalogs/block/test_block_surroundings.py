"""Objects that a map states, read from tags."""

from __future__ import annotations

from pathlib import Path

import geopandas as gpd
import pytest
import shapely
from pyproj import CRS
from shapely import LineString, Point

from catalogs.block.ground import build_block_ground
from catalogs.buildings.surroundings import build_ground_objects, select_objects
from catalogs.features import CentrelinesAndGround, GroundFeature
from catalogs.readers.vectors.ground_classes import osm_ground_tags
from catalogs.readers.vectors.vector_files import read_vector_ground
from facade_core.core.types import MappedGround

AROUND = shapely.box(0, 0, 100, 100)


def test_objects_are_read_with_sizes_and_directions() -> None:
    tags = {"natural": "tree", "height": "40 ft", "diameter_crown": "6 m"}
    (tree,) = build_ground_objects("n1", Point(5, 5), tags, AROUND)
    assert (tree.kind, round(tree.height, 2), tree.width, tree.direction) == ("tree", 12.19, 6.0, None)
    (bench,) = build_ground_objects("n2", Point(5, 5), {"amenity": "bench", "direction": "ENE"}, AROUND)
    assert bench.direction == pytest.approx(67.5)
    assert build_ground_objects("n3", Point(500, 5), tags, AROUND) == []


def test_lines_are_cut_and_closed_ones_are_their_outline() -> None:
    hedge = {"barrier": "hedge"}
    two = build_ground_objects("w1", LineString([(-5, 5), (50, 5), (50, 150), (60, 150), (60, 5)]), hedge, AROUND)
    assert [one.id for one in two] == ["w1-0", "w1-1"]
    (ring,) = build_ground_objects("w2", shapely.box(10, 10, 20, 20), {"barrier": "fence"}, AROUND)
    assert ring.geometry.length == pytest.approx(40)


def test_a_building_is_no_shelter() -> None:
    shelter = {"amenity": "shelter"}
    assert build_ground_objects("w", shapely.box(1, 1, 4, 3), shelter | {"building": "roof"}, AROUND)
    assert not build_ground_objects("w", shapely.box(1, 1, 4, 3), shelter | {"building": "yes"}, AROUND)


def test_objects_of_other_maps_are_known_by_their_words() -> None:
    assert osm_ground_tags({"class": "Baum"})["natural"] == "tree"
    assert osm_ground_tags({}, "street_lamps")["highway"] == "street_lamp"
    assert osm_ground_tags({"class": "hedge"}, is_area=True)["barrier"] == "hedge"
    features = (GroundFeature("1", Point(5, 5), osm_ground_tags({"class": "tree"})),)
    utm = CRS("EPSG:32635")
    ground = build_block_ground([CentrelinesAndGround(None, (), ground=features)], utm, AROUND, None)
    assert [one.kind for one in ground.objects] == ["tree"]


def test_a_crossed_outline_and_an_odd_direction_are_no_fault() -> None:
    crossed = shapely.Polygon([(1, 1), (5, 4), (5, 1), (1, 4)])
    assert build_ground_objects("w", crossed, {"amenity": "parking_space"}, AROUND)
    for odd in ("nan", "inf", "1e400", "both"):
        (bench,) = build_ground_objects("n", Point(5, 5), {"amenity": "bench", "direction": odd}, AROUND)
        assert bench.direction is None


def test_a_fenced_pitch_is_a_pitch_with_a_fence(tmp_path: Path) -> None:
    tags = {"leisure": "pitch", "barrier": "fence"}
    features = (GroundFeature("w", shapely.box(10, 10, 40, 30), tags),)
    ground = build_block_ground([CentrelinesAndGround(None, (), ground=features)], CRS("EPSG:32635"), AROUND, None)
    assert ([one.id for one in ground.areas], [one.kind for one in ground.objects]) == (["w"], ["fence"])
    line = LineString([(1, 1), (90, 1)])
    for more, ways in (({}, []), ({"highway": "footway"}, ["w"])):
        features = (GroundFeature("w", line, {"barrier": "fence"} | more),)
        ground = build_block_ground([CentrelinesAndGround(None, (), ground=features)], CRS("EPSG:32635"), AROUND, None)
        assert ([one.id for one in ground.ways], [one.kind for one in ground.objects]) == (ways, ["fence"])
    frame = gpd.GeoDataFrame({"barrier": ["fence"]}, geometry=[LineString([(1, 1), (9, 1)])], crs="EPSG:32635")
    frame.to_file(tmp_path / "lines.gpkg")
    (fence,) = read_vector_ground(tmp_path / "lines.gpkg").ground
    assert fence.tags["barrier"] == "fence"


def test_props_off_leaves_objects_out() -> None:
    ground = MappedGround(objects=tuple(build_ground_objects("n", Point(5, 5), {"natural": "tree"}, AROUND)))
    assert select_objects(ground, "stated") == ground
    assert select_objects(ground, "off").objects == ()


def test_lit_roads_and_parked_cars_are_plausible() -> None:
    tags = {"highway": "residential", "lit": "yes", "parking:lane:left": "parallel"}
    features = (GroundFeature("w", LineString([(1, 50), (90, 50)]), tags),)
    ground = build_block_ground([CentrelinesAndGround(None, (), ground=features)], CRS("EPSG:32635"), AROUND, None)
    assert [one.kind for one in select_objects(ground, "plausible").objects] == ["street_lamp", "parked_car"]
    assert select_objects(ground, "stated").objects == ()
