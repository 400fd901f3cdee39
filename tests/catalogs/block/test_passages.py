"""Passages of streets through buildings: which are opened, how wide and how high."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import networkx
import numpy as np
import pytest
import shapely
from pyproj import CRS
from shapely import LineString, box

from catalogs.block.digest import block_digest
from catalogs.block.extract import read_city_part, write_city_part_file
from catalogs.block.passages import OpenedPassages, note_closed_passages, open_passages
from catalogs.block.reader import Block, city_part_file_values, read_block
from catalogs.block.streets import build_block_streets
from catalogs.features import Centreline, CentrelinesAndGround, GroundFeature
from catalogs.readers.formats import read_centrelines
from facade_core.core.types import Building, BuildingShell, ElevationRaster

UTM = CRS.from_epsg(32635)
FRONT = Building("front", box(0, 0, 40, 10), 12.0, "height")
REAR = Building("rear", box(0, 10, 40, 20), 9.0, "height")
CLOSED = "passages through buildings closed, without viewpoints"
LOW = "passages through buildings too low for them closed, without viewpoints"
INNER = "passages that do not reach the walls of their buildings closed, without viewpoints"
ASSUMED = "passages through buildings opened to an assumed height of 3.5 m"
OPENED = "passages through buildings opened"
AREA = "passages through buildings drawn as areas closed; draw them as lines"
NO_ROOM = "buildings with passages closed, as their walls are too low over the ground there"
UNREAD = "heights of passages not understood, 3.5 m assumed; write maxheight in metres"


def street(id: str, *points: tuple[float, float], **tags: str) -> Centreline:
    passage = {"highway": "residential", "tunnel": "building_passage", **tags} if tags.pop("passage", "yes") else None
    return Centreline(id, LineString(points), "Hof", passage)


def open_block_passages(buildings: list[Building], *pieces: Centreline) -> OpenedPassages:
    return open_passages(buildings, CentrelinesAndGround(None, pieces), (), UTM)


def open_by_features(buildings: list[Building], *features: GroundFeature) -> OpenedPassages:
    source = CentrelinesAndGround("EPSG:32635", (), ground=features)
    return open_passages(buildings, CentrelinesAndGround(None, ()), [source], UTM)


def way(id: str, *points: tuple[float, float], **tags: str) -> GroundFeature:
    return GroundFeature(id, LineString(points), {"tunnel": "building_passage", **tags})


def open_area(building: Building) -> float:
    return sum(passage.corridor.intersection(building.footprint).area for passage in building.passages)


def shell() -> BuildingShell:
    corners = np.array([[0, 0, 0], [40, 0, 0], [0, 10, 9]], np.float64)
    return BuildingShell(
        corners, np.array([[0, 1, 2]], np.int32), np.zeros(1, np.uint8), np.full(1, -1, np.int32),
        np.zeros((1, 3, 2), np.float32),
    )  # fmt: skip


def test_a_passage_through_one_building_is_open_and_part_of_its_street() -> None:
    pieces = (
        street("w1", (20, -20), (20, 0), passage=""),
        street("w2", (20, 0), (20, 10), width="4", maxheight="3.2"),
        street("w3", (20, 10), (20, 30), passage=""),
    )
    found = open_block_passages([FRONT, REAR], *pieces)
    front, rear = found.buildings
    assert rear is REAR
    assert [passage.height for passage in front.passages] == [3.2]
    assert front.passages[0].corridor.intersection(front.footprint).equals(box(18, 0, 22, 10))
    assert found.reasons == {OPENED: ["w2"]}
    (whole,) = build_block_streets(found.streets, UTM, area=None)[0]
    assert whole.line.length == 50


def test_a_passage_through_two_adjacent_buildings_opens_the_party_wall() -> None:
    for pieces in (
        [street("w1", (20, 0), (20, 20), width="4")],
        [street("w1", (20, 0), (20, 10), width="4"), street("w2", (20, 20), (20, 10), width="4")],
        [street("w1", (20, 0), (20, 7), width="4"), street("w2", (20, 7), (20, 20), width="4")],
    ):
        found = open_block_passages([FRONT, REAR], *pieces)
        assert [open_area(one) for one in found.buildings] == pytest.approx([40, 40])
        for one in found.buildings:
            for wall in ((18, 10), (22, 10)):
                assert shapely.union_all([passage.corridor for passage in one.passages]).covers(shapely.Point(wall))


@pytest.mark.parametrize(
    "points",
    [
        [(-3, 0.5), (0.5, -3)],  # beside a corner, which its width touches
        [(-1, 1.4), (1.4, -1)],  # over a corner
        [(-5, 5), (0.3, 5)],  # to the wall
        [(-1, -1), (41, -1)],  # along the wall
    ],
)
def test_a_passage_that_grazes_a_building_leaves_it_closed_and_stays_a_street(
    points: list[tuple[float, float]],
) -> None:
    found = open_block_passages([FRONT], street("w1", *points))
    assert found.buildings == (FRONT,)
    assert found.reasons == {}
    assert len(found.streets.items) == 1


@pytest.mark.parametrize(("height", "reason"), [(12.0, OPENED), (4.0, OPENED), (2.5, OPENED), (2.4, LOW)])
def test_a_passage_higher_than_its_building(height: float, reason: str) -> None:
    found = open_block_passages([replace(FRONT, height=height)], street("w1", (20, 0), (20, 10), maxheight="4.2"))
    assert found.reasons == {reason: ["w1"]}
    assert bool(found.buildings[0].passages) == (reason == OPENED), "the geometry limits the ceiling"
    assert len(found.streets.items) == (reason == OPENED)


def test_a_passage_through_a_model_is_closed_and_cuts_its_street() -> None:
    model = replace(FRONT, shell=shell(), height_source="model")
    pieces = (
        street("w1", (20, -20), (20, 0), passage=""),
        street("w2", (20, 0), (20, 20)),
        street("w3", (20, 20), (20, 40), passage=""),
    )
    found = open_block_passages([model, REAR], *pieces)
    assert found.buildings == (model, REAR), "closed also in the extruded building behind"
    assert found.reasons == {CLOSED: ["w2"]}
    assert len(build_block_streets(found.streets, UTM, area=None)[0]) == 2


@pytest.mark.parametrize(
    ("points", "area"),
    [
        ([(20, 0.8), (20, 9.2)], 40.0),  # mapped short of the walls
        ([(20, -3), (20, 14)], 40.0),  # and beyond
        ([(15, 0), (25, 10)], None),  # askew: the whole width reaches through
        ([(20, 0), (20, 5)], 36.0),  # ends inside: as far as its end may be off
    ],
)
def test_ends_of_passages(points: list[tuple[float, float]], area: float | None) -> None:
    (front,) = open_block_passages([FRONT], street("w1", *points, width="4")).buildings
    assert open_area(front) == pytest.approx(4 * 10 * 2**0.5 if area is None else area)


def test_a_passage_inside_of_a_building_stays_closed() -> None:
    large = replace(FRONT, footprint=box(0, 0, 60, 60))
    found = open_block_passages([large], street("w1", (20, 20), (20, 40)))
    assert found.buildings == (large,)
    assert found.reasons == {INNER: ["w1"]}


def test_a_part_that_begins_above_the_passage_needs_no_height_below() -> None:
    bridge = replace(FRONT, raised=4.0, height=4.2)
    found = open_block_passages([bridge], street("w1", (20, 0), (20, 10), maxheight="3"))
    assert found.reasons == {OPENED: ["w1"]}
    assert found.buildings[0].passages, "cameras are placed below it"


@pytest.mark.parametrize(
    ("tags", "width", "height", "reason"),
    [
        ({}, 6.0, 3.5, ASSUMED),
        ({"highway": "pedestrian"}, 6.0, 3.5, ASSUMED),
        ({"highway": "residential", "oneway": "yes", "maxheight": "default"}, 4.0, 3.5, ASSUMED),
        ({"lanes": "1", "maxheight": "3"}, 3.0, 3.0, OPENED),
        ({"width": "1", "maxheight:physical": "3.4", "maxheight": "3.1"}, 2.0, 3.4, OPENED),
        ({"width": "3.5 m", "maxheight": "11'6\""}, 3.5, 3.51, OPENED),
        ({"width": "wide", "maxheight": "high"}, 6.0, 3.5, UNREAD),
        ({"maxheight": "99"}, 6.0, 3.5, UNREAD),
    ],
)  # fmt: skip
def test_width_and_height_by_tags(tags: dict[str, str], width: float, height: float, reason: str) -> None:
    found = open_block_passages([FRONT], street("w1", (20, 0), (20, 10), **tags))
    (passage,) = found.buildings[0].passages
    assert (open_area(found.buildings[0]) / 10, passage.height) == (pytest.approx(width), pytest.approx(height))
    assert found.reasons == {reason: ["w1"]}


@pytest.mark.parametrize(
    ("tags", "width"),
    [
        ({"highway": "footway"}, 2.2),
        ({"highway": "footway", "footway": "sidewalk"}, 2.2),
        ({"highway": "path", "width": "3"}, 3.0),
        ({"highway": "steps"}, 2.5),
        ({"highway": "service"}, 3.2),
        ({"railway": "tram"}, 3.0),
    ],
)
def test_ways_without_viewpoints_open_buildings(tags: dict[str, str], width: float) -> None:
    found = open_by_features([FRONT, REAR], way("w1", (20, -5), (20, 25), **tags))
    assert [open_area(one) for one in found.buildings] == pytest.approx([10 * width, 10 * width])
    assert found.reasons == {ASSUMED: ["w1"]}
    assert found.streets.items == ()


@pytest.mark.parametrize(
    "tags", [{"highway": "proposed"}, {"waterway": "canal"}, {"highway": "footway", "tunnel": "no"}]
)
def test_ways_that_lead_through_no_building(tags: dict[str, str]) -> None:
    found = open_by_features([FRONT], way("w1", (20, -5), (20, 15), **tags))
    assert (found.buildings, found.reasons) == ((FRONT,), {})


def test_a_street_among_the_ground_features_counts_once() -> None:
    piece = street("w1", (20, 0), (20, 10), width="4")
    twin = way("w1", (20, 10), (20, 0), highway="residential", width="4")
    source = CentrelinesAndGround("EPSG:32635", (piece,), ground=(twin,))
    found = open_passages([FRONT], source, [source], UTM)
    assert len(found.buildings[0].passages) == 1
    assert found.reasons == {ASSUMED: ["w1"]}


def test_an_area_through_a_building_stays_closed_with_a_note() -> None:
    tags = {"highway": "pedestrian", "area": "yes", "tunnel": "building_passage"}
    found = open_by_features(
        [FRONT], GroundFeature("a", box(15, -5, 25, 15), tags), GroundFeature("b", box(0, -5, 40, 0), tags)
    )
    assert (found.buildings, found.reasons) == ((FRONT,), {AREA: ["a"]})


def test_a_passage_without_room_over_the_terrain_is_noted() -> None:
    slope = ElevationRaster(-50.0, 70.0, 1.0, np.tile(np.arange(141, dtype=np.float32)[::-1, None] / 2, (1, 141)))
    low = open_block_passages([replace(FRONT, height=5.5)], street("w1", (20, 0), (20, 10))).buildings
    assert note_closed_passages(low, None) == ()
    assert note_closed_passages(low, slope) == (f"{NO_ROOM}: 1 (front)",)
    assert note_closed_passages([FRONT], slope) == ()


def write_block(folder: Path, tunnel: str | None) -> Path:
    def collection(*features: tuple[dict[str, object], shapely.Geometry]) -> str:
        rows = [
            {"type": "Feature", "properties": properties, "geometry": shapely.geometry.mapping(shape)}
            for properties, shape in features
        ]
        return json.dumps({"type": "FeatureCollection", "features": rows})

    x, y = 385_000, 6_671_000
    places = [[(x + 20, y - 20), (x + 20, y)], [(x + 20, y), (x + 20, y + 10)], [(x + 20, y + 10), (x + 20, y + 30)]]
    folder.mkdir()
    (folder / "streets.geojson").write_text(
        collection(
            *(
                (
                    {"id": n, "name": "Hof", "highway": "residential", "tunnel": tunnel if n == 1 else None},
                    LineString(p),
                )
                for n, p in enumerate(places)
            )
        )
    )
    houses = [({"id": "a", "height": 12, "building": "yes"}, box(x, y, x + 40, y + 10))]
    (folder / "buildings.geojson").write_text(collection(*houses))
    (folder / "block.yaml").write_text(
        "name: passage\ncrs: EPSG:32635\nbuildings: {path: buildings.geojson, crs: 'EPSG:32635'}\n"
        "streets: {path: streets.geojson, crs: 'EPSG:32635'}\n"
        "texture: {walls: translate}\n"
    )
    return folder / "block.yaml"


def test_a_street_graph_states_passages_in_both_directions(tmp_path: Path) -> None:
    graph = networkx.MultiDiGraph(crs="EPSG:32635")
    for node, y in enumerate((-20.0, 0.0, 10.0, 30.0)):
        graph.add_node(node, x=20.0, y=y)
    for start, end in ((0, 1), (1, 2), (2, 3)):
        tags = {"highway": "residential", "name": "Hof", "osmid": str(start)}
        if start == 1:
            tags |= {"tunnel": "['building_passage', 'no']", "width": "['4', '5']"}
        graph.add_edge(start, end, **tags)
        graph.add_edge(end, start, **tags)
    networkx.write_graphml(graph, tmp_path / "streets.graphml")
    found = open_block_passages([FRONT], *read_centrelines(tmp_path / "streets.graphml").items)
    assert open_area(found.buildings[0]) == pytest.approx(40)
    assert found.reasons == {ASSUMED: ["w1"]}


def test_a_block_with_a_passage_and_one_without(tmp_path: Path) -> None:
    blocks: list[Block] = [
        read_block(write_block(tmp_path / str(tunnel), tunnel)) for tunnel in ("building_passage", None)
    ]
    passage, plain = blocks
    assert [len(block.streets) for block in blocks] == [1, 1]
    assert passage.streets == plain.streets
    assert f"{ASSUMED}: 1 (1)" in passage.notes
    assert not any("passage" in note for note in plain.notes)
    assert block_digest(passage) != block_digest(plain)
    write_city_part_file(tmp_path / "part.npz", city_part_file_values(passage, passage))
    assert read_city_part(tmp_path / "part.npz").contents["buildings"] == passage.buildings
    closed = replace(passage, buildings=plain.buildings, notes=plain.notes)
    assert block_digest(closed) == block_digest(replace(plain, ground=passage.ground))


def test_a_passage_of_another_street_than_those_of_the_block(tmp_path: Path) -> None:
    path = write_block(tmp_path / "block", "building_passage")
    streets = json.loads((path.parent / "streets.geojson").read_text())
    places = [(385_000 - 30, 6_671_000 - 10), (385_000 + 70, 6_671_000 - 10)]
    other = {"id": 9, "name": "Front Street", "highway": "residential"}
    streets["features"].append(
        {"type": "Feature", "properties": other, "geometry": {"type": "LineString", "coordinates": places}}
    )
    (path.parent / "streets.geojson").write_text(json.dumps(streets))
    path.write_text(path.read_text().replace("{path: streets.geojson", "{names: [Front Street], path: streets.geojson"))
    block = read_block(path)
    assert [one.name for one in block.streets] == ["Front Street"]
    assert len(block.buildings[0].passages) == 1
    assert f"{ASSUMED}: 1 (1)" in block.notes
    path.write_text("\n".join(line for line in path.read_text().splitlines() if not line.startswith("streets")))
    path.write_text(path.read_text() + "\nground: {path: streets.geojson, crs: 'EPSG:32635'}\n")
    block = read_block(path)
    assert block.streets == ()
    assert len(block.buildings[0].passages) == 1
    assert f"{ASSUMED}: 1 (1)" in block.notes


def test_a_corrected_height_that_closes_a_passage_is_noted(tmp_path: Path) -> None:
    path = write_block(tmp_path / "block", "building_passage")
    path.with_suffix(".corrections.jsonl").write_text('{"id": "a", "what": "height", "value": 2.2}\n')
    assert f"{NO_ROOM}: 1 (a)" in read_block(path).notes
