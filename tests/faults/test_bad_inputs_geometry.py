"""Geometry that cannot be used: one line with the file and the remedy, or the unit set aside; never another exception."""

from __future__ import annotations

import json
import math
import re
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
import shapely

from catalogs.block.reader import Block, read_block
from facade_core.core.errors import BlockFileError
from tasks.stages.ingest.planning import make_plan
from tasks.stages.ingest.task import explain_missing_street_facades

EAST, NORTH = 385_000.0, 6_671_000.0
Make = Callable[[Path], str]


def square(x: float = 0.0, y: float = 0.0, side: float = 12.0) -> list[list[float]]:
    east, north = EAST + x, NORTH + y
    return [[east, north], [east + side, north], [east + side, north + side], [east, north + side], [east, north]]


def feature(kind: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": {"type": kind, "coordinates": coordinates}}


def outlines(**properties: Any) -> Make:
    """A good building, and one with these properties."""

    def make(folder: Path) -> str:
        features = [
            feature("Polygon", [square()], id="good", height=7.0),
            feature("Polygon", [square(30)], **{"id": "bad", "height": 7.0} | properties),
        ]
        (folder / "b.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
        return "b.geojson"

    return make


def boxes(name: str, *lines: str) -> Make:
    """A good box, and one called `name` behind which further lines stand."""

    def make(folder: Path) -> str:
        text = []
        for number, (group, x) in enumerate((("good", 0.0), (name, 30.0))):
            ring = square(x)[:-1]
            text.append(f"g {group}")
            text += [f"v {a} {b} {z}" for z in (0.0, 7.0) for a, b in ring]
            sides = [(i, (i + 1) % 4, (i + 1) % 4 + 4, i + 4) for i in range(4)]
            for face in ((3, 2, 1, 0), (4, 5, 6, 7), *sides):
                text.append("f " + " ".join(str(8 * number + corner + 1) for corner in face))
        (folder / "b.obj").write_text("\n".join([*text, *lines, ""]))
        return "b.obj"

    return make


def walls(building: str = "bad", corner: Any = EAST) -> Make:
    def make(folder: Path) -> str:
        def front(x: Any) -> dict[str, Any]:
            return {"0": [[x, NORTH, 0.0], [EAST + 40.0, NORTH, 0.0], [EAST + 40.0, NORTH, 9.0], [x, NORTH, 9.0]]}

        near = {
            "0": [[EAST, NORTH + 30, 0], [EAST + 9, NORTH + 30, 0], [EAST + 9, NORTH + 30, 9], [EAST, NORTH + 30, 9]]
        }
        content = {"crs": "EPSG:32635", "walls": {"good": near, building: front(corner)}}
        (folder / "b.json").write_text(json.dumps(content))
        return "b.json"

    return make


def block_of(folder: Path, path: str, **keys: Any) -> Block:
    """Read a block of one building file."""
    block = {"name": "bad", "crs": "EPSG:32635", "buildings": {"path": path, "crs": "EPSG:32635"}}
    texture = {"texture": {"walls": "translate"}}
    stated = {key: value for key, value in (block | texture | keys).items() if value is not None}
    (folder / "block.yaml").write_text(json.dumps(stated))
    return read_block(folder / "block.yaml")


# The faces of a third box.
UP = [
    f"f {a + 16} {b + 16} {c + 16} {d + 16}" for a, b, c, d in ((4, 3, 2, 1), (5, 6, 7, 8), (1, 2, 6, 5), (2, 3, 7, 6))
]
DIGITS = "9" * 5000
# What is made, the building it is about, and what is said of it; "" where nothing need be said.
UNITS: dict[str, tuple[Make, str]] = {
    "a height of 400 digits of feet": (outlines(height=f"{'9' * 400}' 4''"), "heights not understood and ignored"),
    "a height of 5000 digits of feet": (outlines(height=f"{DIGITS}'4''"), "heights not understood and ignored"),
    "a least height of 400 digits": (outlines(min_height=f"{'9' * 400}'4''"), ""),
    "a roof of 400 digits": (outlines(roof_height=f"{'9' * 400}'4''", roof_shape="gabled"), ""),
    "an id of 5000 digits": (outlines(id=DIGITS), "its id has 5000 letters, more than 1000"),
    "an id with half a character": (walls("\ud800"), "its id holds what is no letter"),
    "a name that is an empty list": (outlines(name="[]"), ""),
    "a name of nested JSON": (outlines(name='{"a":' * 5000 + "1" + "}" * 5000), ""),
    "a corner of 400 digits": (walls(corner=int("9" * 400)), "wall 0 is no list of three or more"),
    "a name of 5000 digits": (boxes(DIGITS), "its id has 5000 letters"),
    "a vertex at 1e300": (boxes("bad", "v 1e300 0 0", "f 9 10 17"), "absurdly far away"),
    "a box 10^8 m up": (
        boxes("bad", "g up", *(f"v {a} {b} {z}" for z in (1e8, 1e8 + 7) for a, b in square(60)[:-1]), *UP),
        "at a height of 1e+08 m",
    ),
    "a vertex index of 30 digits": (boxes("bad", f"f 9 10 {'9' * 30}"), "a vertex that is missing"),
    "a texture index of 30 digits": (boxes("bad", f"f 9/{'9' * 30} 10/1 11/1"), ""),
    "a face of 20,000 corners": (boxes("bad", "f " + "9 10 11 12 " * 5000), "a face of over 10000 corners"),
}


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("case", UNITS)
def test_a_broken_building_is_set_aside(case: str, tmp_path: Path) -> None:
    make, words = UNITS[case]
    block = block_of(tmp_path, make(tmp_path))
    said = [*(fault.reason for fault in block.faults), *block.notes]
    assert "good" in {building.id.removesuffix("-0") for building in block.buildings}
    assert any(words in line for line in said) if words else len(block.buildings) == 2
    assert not any("\n" in line for line in said)


def test_a_block_of_broken_buildings_is_refused_with_the_first_reason(tmp_path: Path) -> None:
    (tmp_path / "b.geojson").write_text(json.dumps(feature("Polygon", [square()], id=DIGITS)))
    with pytest.raises(
        BlockFileError, match=r"^\S+block\.yaml: buildings\.path: \S+b\.geojson has no buildings.*5000"
    ) as refusal:
        block_of(tmp_path, "b.geojson")
    assert re.search(r"\n", str(refusal.value)) is None


# One of five buildings lies elsewhere, in a frame: what is said of it.
APART: dict[str, tuple[str, Sequence[float], str]] = {
    "null island": ("EPSG:4326", (0.0, 0.0), r"it lies at 0\.000\d, 0\.000\d, 6,\d\d\d km from the other 4"),
    "swapped axes": ("EPSG:4326", (60.16, 24.93), r"it lies at 60\.160\d, 24\.930\d, 4,\d\d\d km from the other 4"),
    "no latitude": ("EPSG:4326", (24.93, 160.0), "it lies nowhere on Earth"),
    "a longitude of 1000": ("EPSG:4326", (1000.0, 60.16), "it lies nowhere on Earth"),
    "another village": ("EPSG:4326", (25.2, 60.16), "it lies at 25.2.*15 km from the other 4"),
    "the origin of the frame": ("EPSG:32635", (0.0, 0.0), "6,.* km from the other 4"),
    "10^8 m away": ("EPSG:32635", (1e8, 6_671_000.0), "nowhere on Earth|km from the other 4"),
    "10^12 m away": ("EPSG:32635", (1e12, 6_671_000.0), "absurdly far away"),
    "half the zone away": ("EPSG:32635", (700_000.0, 6_671_000.0), "31. km from the other 4"),
}


def five(folder: Path, crs: str, other: Sequence[float], side: float | None = None) -> str:
    """Four buildings in a row, and one elsewhere."""
    metres = crs != "EPSG:4326"
    origin = (EAST, NORTH) if metres else (24.93, 60.16)
    width = 12.0 if metres else 0.0003
    places = [(origin[0] + 2 * number * width, origin[1]) for number in range(4)]
    features = [
        feature("Polygon", [rectangle(x, y, width if number < 4 else side or width)], id=str(number), height=7)
        for number, (x, y) in enumerate([*places, tuple(other)])
    ]
    (folder / "b.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return "b.geojson"


def rectangle(x: float, y: float, side: float) -> list[list[float]]:
    return [[x, y], [x + side, y], [x + side, y + side], [x, y + side], [x, y]]


@pytest.mark.parametrize("case", APART)
def test_a_building_apart_from_the_others_is_set_aside(case: str, tmp_path: Path) -> None:
    crs, other, words = APART[case]
    block = block_of(tmp_path, five(tmp_path, crs, other), buildings={"path": "b.geojson", "crs": crs})
    assert [building.id for building in block.buildings] == ["0", "1", "2", "3"]
    assert [fault.id for fault in block.faults] == ["4"]
    assert re.search(words, block.faults[0].reason), block.faults[0].reason


def test_a_building_that_reaches_half_around_the_earth_is_set_aside(tmp_path: Path) -> None:
    features = [feature("Polygon", [square(30 * number)], id=str(number), height=7) for number in range(2)]
    corner = square(60)
    corner[2] = [0.0, 0.0]
    features.append(feature("Polygon", [corner], id="corner", height=7))
    features.append(feature("Polygon", [square(0, 0, 6e6)], id="wide", height=7))
    (tmp_path / "b.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    block = block_of(tmp_path, "b.geojson")
    assert [building.id for building in block.buildings] == ["0", "1"]
    assert {fault.id for fault in block.faults} == {"corner", "wide"}
    assert all("a building is up to 5 km" in fault.reason for fault in block.faults)


def test_buildings_in_two_places_are_refused_unless_streets_or_an_area_tell_which_is_meant(tmp_path: Path) -> None:
    features = [
        feature("Polygon", [square()], id="a", height=7),
        feature("Polygon", [square(900_000)], id="b", height=7),
    ]
    (tmp_path / "b.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    with pytest.raises(BlockFileError, match=r"the buildings span 894 km \(1 at .*; 1 at .*give area"):
        block_of(tmp_path, "b.geojson")
    meant = block_of(tmp_path, "b.geojson", area=[24.9, 60.1, 25.0, 60.2])
    assert [building.id for building in meant.buildings] == ["a"]
    line = [[EAST, NORTH - 8], [EAST + 40, NORTH - 8]]
    (tmp_path / "s.geojson").write_text(json.dumps(feature("LineString", line, id="1")))
    beside = block_of(tmp_path, "b.geojson", streets={"path": "s.geojson", "crs": "EPSG:32635"})
    assert [building.id for building in beside.buildings] == ["a"]
    assert [fault.id for fault in beside.faults] == ["b"]
    with pytest.raises(BlockFileError, match=r"area: \[-180.0, -90.0, 180.0, 90.0\] spans .* km; give the block's own"):
        block_of(tmp_path, "b.geojson", area=[-180.0, -90.0, 180.0, 90.0])


def test_a_hole_outside_its_outline_is_no_building(tmp_path: Path) -> None:
    rings = [square(), square(3, 3, 4), square(50)]
    (tmp_path / "b.geojson").write_text(json.dumps(feature("Polygon", rings, id="a", height=7)))
    block = block_of(tmp_path, "b.geojson")
    assert [(building.id, building.footprint.area) for building in block.buildings] == [("a", 144.0 - 16.0)]
    assert "holes outside their outlines ignored: 1 (a)" in block.notes


def test_streets_are_followed_to_the_surroundings_and_a_point_far_away_breaks_one(tmp_path: Path) -> None:
    (tmp_path / "b.geojson").write_text(json.dumps(feature("Polygon", [square()], id="a", height=7)))
    lines = {
        "long": [[EAST - 9000, NORTH - 8], [EAST + 9000, NORTH - 8]],
        "far": [[EAST, NORTH + 5000], [EAST + 50, NORTH + 5000]],
        "broken": [[EAST, NORTH - 9], [EAST + 40, NORTH - 9], [0.0, 0.0]],
    }
    features = [feature("LineString", line, id=id) for id, line in lines.items()]
    (tmp_path / "s.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    block = block_of(tmp_path, "b.geojson", streets={"path": "s.geojson", "crs": "EPSG:32635"})
    assert [(street.id, round(street.line.length)) for street in block.streets] == [("slong", 2012)]
    assert [fault.id for fault in block.faults] == ["broken"]
    assert "a stretch of 6,682 km without a point" in block.faults[0].reason
    assert "streets cut off over 1000 m from the buildings: 2 (far, long)" in block.notes


def test_units_of_one_id_are_numbered_with_a_note_and_a_photo_is_the_first_ones(tmp_path: Path) -> None:
    ids = ["x", "y", "x", "z"]
    features = [feature("Polygon", [square(30 * row)], id=id, height=7) for row, id in enumerate(ids)]
    (tmp_path / "b.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    lines = [feature("LineString", [[EAST, NORTH - 8 - y], [EAST + 99, NORTH - 8 - y]], id=7) for y in (0, 60)]
    lines += [feature("LineString", [[EAST, NORTH + 60 + y], [EAST + 99, NORTH + 60 + y]], id=y) for y in (8, 9)]
    lines.append(feature("LineString", [[EAST, NORTH + 9000], [EAST + 99, NORTH + 9000]], id=7))  # of another place
    (tmp_path / "s.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": lines}))
    block = block_of(tmp_path, "b.geojson", streets={"path": "s.geojson", "crs": "EPSG:32635"})
    assert [building.id for building in block.buildings] == ["x", "x-2", "y", "z"]
    assert "buildings of b.geojson numbered since another has their id: 1 (x-2)" in block.notes
    assert "streets of s.geojson numbered since another has their id: 1 (7-2)" in block.notes
    assert block.buildings[0].footprint.bounds[0] == EAST  # a photo x-0 is of the first in the file
    assert {"x-0", "x-2-0"} <= set(make_plan(block).facades.id)


def test_a_street_longer_than_any_is_set_aside(tmp_path: Path) -> None:
    (tmp_path / "b.geojson").write_text(json.dumps(feature("Polygon", [square()], id="a", height=7)))
    lines = {
        "zigzag": [[EAST + 60 * (number % 2), NORTH - 8 - number / 100] for number in range(3000)],
        "good": [[EAST, NORTH + 20], [EAST + 40, NORTH + 20]],
    }
    features = [feature("LineString", line, id=id) for id, line in lines.items()]
    (tmp_path / "s.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    block = block_of(tmp_path, "b.geojson", streets={"path": "s.geojson", "crs": "EPSG:32635"})
    assert [street.id for street in block.streets] == ["sgood"]
    assert [(fault.id, fault.reason) for fault in block.faults] == [
        (
            "zigzag",
            "is 180 km long within the block, over 60: no street is; draw it again, remove it, or give area",
        )
    ]


@pytest.mark.parametrize("longitude", [-350.0, 10.0, 370.0 - 360.0, 359.9, -179.9999, 179.9999, 180.0])
def test_longitudes_of_any_turn_are_the_same_places(longitude: float, tmp_path: Path) -> None:
    features = [
        feature("Polygon", [rectangle(longitude + x, 60.0, 0.0003)], id=str(number), height=7)
        for number, x in enumerate((0.0, 0.001))
    ]
    (tmp_path / "b.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    block = block_of(tmp_path, "b.geojson", crs=None, buildings={"path": "b.geojson", "crs": "EPSG:4326"})
    zone = int((longitude + 0.0006 + 180) % 360 // 6) + 1
    assert block.crs.to_string() == f"EPSG:326{zone:02d}"
    assert [round(building.footprint.area) for building in block.buildings] == [559, 559]


# Frames of a block, of its buildings and of its streets that cannot be used.
FRAMES = {
    "EPSG:1": "is not a known CRS",
    "x" * 100_000: "is not a known CRS",
    'LOCAL_CS["x",UNIT["metre",1]]': "Engineering CRS, which has no places on a map",
    "IAU_2015:30110": "not a frame of the Earth",
    "ESRI:104903": "not a frame of the Earth|not a known CRS",
    "EPSG:4978": "Geocentric CRS, which has no places on a map",
    "EPSG:5773": "Vertical CRS, which has no places on a map",
    "+proj=utm +zone=35 +ellps=bessel +nadgrids=nope.gsb": "no transformation is known|not a known CRS",
    "+proj=utm +zone=35 +ellps=bessel +nadgrids=/dev/zero": "names a grid file of this machine",
    "+proj=utm +zone=35 +ellps=bessel +nadgrids=@../x.gsb": "names a grid file of this machine",
    "+proj=longlat +a=1 +b=1": "not a frame of the Earth",
    "+proj=pipeline +step +proj=axisswap +order=2,1": "is not a known CRS",
}


@pytest.mark.parametrize("key", ["crs", "buildings.crs", "streets.crs"])
@pytest.mark.parametrize("crs", FRAMES)
def test_a_frame_that_cannot_be_used_is_one_line_with_the_key(key: str, crs: str, tmp_path: Path) -> None:
    (tmp_path / "b.geojson").write_text(json.dumps(feature("Polygon", [square()], id="a", height=7)))
    (tmp_path / "s.geojson").write_text(json.dumps(feature("LineString", [[EAST, NORTH], [EAST + 9, NORTH]], id="1")))
    keys = {
        "buildings": {"path": "b.geojson", "crs": "EPSG:32635"},
        "streets": {"path": "s.geojson", "crs": "EPSG:32635"},
    }
    keys |= {"crs": crs} if key == "crs" else {key.partition(".")[0]: {**keys[key.partition(".")[0]], "crs": crs}}
    with pytest.raises(BlockFileError, match=FRAMES[crs]) as refusal:
        block_of(tmp_path, "b.geojson", **keys)
    assert f"block.yaml: {key}: " in str(refusal.value)
    assert len(str(refusal.value).splitlines()) == 1
    assert len(str(refusal.value)) < 600


@pytest.mark.parametrize(
    ("crs", "place", "instead"),
    [
        ("EPSG:5513", (14.42, 50.08), "EPSG:5514"),
        ("EPSG:2065", (14.42, 50.08), "EPSG:5221"),
        ("EPSG:2048", (18.42, -33.92), "EPSG:32734"),
        ("+proj=utm +zone=33 +axis=wsu +datum=WGS84", (14.42, 50.08), "EPSG:32633"),
        ("+proj=utm +zone=33 +axis=esu +datum=WGS84", (14.42, 50.08), "EPSG:32633"),
    ],
)
def test_a_frame_that_would_mirror_or_turn_the_block_is_refused_or_converted(
    crs: str, place: tuple[float, float], instead: str, tmp_path: Path
) -> None:
    # an L, whose long arm points north and whose short one points east
    corners = [(0, 0), (4, 0), (4, 1), (1, 1), (1, 8), (0, 8), (0, 0)]
    ring = [[place[0] + 6e-5 * x, place[1] + 6e-5 * y] for x, y in corners]
    (tmp_path / "b.geojson").write_text(json.dumps(feature("Polygon", [ring], id="L", height=7)))
    keys = {"buildings": {"path": "b.geojson", "crs": "EPSG:4326"}}
    with pytest.raises(BlockFileError, match=f"crs: .* mirrors or turns a block; .* e.g. {instead}, or leave crs out"):
        block_of(tmp_path, "b.geojson", crs=crs, **keys)
    from pyproj import Transformer

    # the same building in coordinates of that frame comes out as it is
    own = [list(Transformer.from_crs("EPSG:4326", crs, always_xy=True).transform(*corner)) for corner in ring]
    (tmp_path / "b.geojson").write_text(json.dumps(feature("Polygon", [own], id="L", height=7)))
    block = block_of(tmp_path, "b.geojson", crs=None, buildings={"path": "b.geojson", "crs": crs})
    assert block.crs.to_string() not in (crs,)
    outline = block.buildings[0].footprint
    west, south, east, north = outline.bounds
    assert outline.centroid.x < (west + east) / 2
    assert outline.contains(shapely.Point(west + 0.1 * (east - west), north - 0.1 * (north - south)))


def test_coordinates_of_east_and_north_under_a_frame_of_south_and_west_are_told(tmp_path: Path) -> None:
    ring = rectangle(-743_000.0, -1_043_000.0, 12.0)
    (tmp_path / "b.geojson").write_text(json.dumps(feature("Polygon", [ring], id="a", height=7)))
    with pytest.raises(BlockFileError, match=r"south and west|nowhere on Earth"):
        block_of(tmp_path, "b.geojson", crs=None, buildings={"path": "b.geojson", "crs": "EPSG:5513"})


@pytest.mark.parametrize(
    ("texture", "height", "words"),
    [
        ({"texels_per_metre": 2}, 7.0, "4 have under 16 texels a side (raise texture.texels_per_metre)"),
        ({"texels_per_metre": 20}, 2.2, "4 are under 3 x 2.5 m"),
        ({"texels_per_metre": 20, "visibility_range": 5}, 7.0, "4 are seen from no street"),
    ],
)
def test_a_block_without_a_facade_says_so(texture: dict[str, Any], height: float, words: str, tmp_path: Path) -> None:
    (tmp_path / "b.geojson").write_text(json.dumps(feature("Polygon", [square()], id="a", height=height)))
    line = [[EAST - 5, NORTH - 14], [EAST + 20, NORTH - 14]]
    (tmp_path / "s.geojson").write_text(json.dumps(feature("LineString", line, id="1")))
    settings = {"walls": "translate", "panorama_width": 64} | texture
    streets = {"path": "s.geojson", "crs": "EPSG:32635"}
    plan = make_plan(block_of(tmp_path, "b.geojson", streets=streets, texture=settings))
    (reason,) = explain_missing_street_facades(plan)
    assert reason.startswith("none of the ")
    assert words in reason
    seen = make_plan(block_of(tmp_path, "b.geojson", texture={"walls": "translate", "panorama_width": 64}))
    assert bool(explain_missing_street_facades(seen)) == (height < 2.5)


def test_the_smallest_bad_inputs_that_were_found_are_one_line_or_set_aside(data: Path) -> None:
    kinds = ("geo-", "krovak", "ll-", "one-", "key-bcrs", "key-offset", "building-id", "zzlong")
    blocks = [path for path in sorted((data / "bad_inputs").glob("*/block.yaml")) if path.parent.name.startswith(kinds)]
    if not blocks:
        pytest.skip(f"no bad inputs in {data}")
    for path in blocks:
        found = _read(path)
        if isinstance(found, Block):
            assert found.buildings, path
            assert not any("\n" in fault.reason for fault in found.faults), path
        else:
            assert len(found.splitlines()) == 1, path
            assert found.startswith(f"{path}: "), path
            assert "; " in found, path


def _read(path: Path) -> Block | str:
    try:
        return read_block(path)
    except BlockFileError as refusal:
        return str(refusal)


@pytest.mark.parametrize(("quarter", "usable"), [(600, True), (3000, False)])
def test_an_outline_of_more_corners_than_a_plan_holds(tmp_path: Path, quarter: int, usable: bool) -> None:
    circle = shapely.Point(EAST + 40, NORTH).buffer(6, quad_segs=quarter)

    def make(folder: Path) -> str:
        features = [
            feature("Polygon", [square()], id="good", height=7.0),
            feature("Polygon", [[list(point) for point in circle.exterior.coords]], id="circle", height=7.0),
        ]
        (folder / "b.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
        return "b.geojson"

    block = block_of(tmp_path, make(tmp_path))
    if usable:
        found = {building.id: building.footprint for building in block.buildings}["circle"]
        assert shapely.get_num_coordinates(found) <= 2000
        assert found.area == pytest.approx(circle.area, rel=0.001)
        assert any("outlines of more than 2000 corners simplified" in note for note in block.notes)
    else:
        assert [building.id for building in block.buildings] == ["good"]
        assert "its outline has 12001 corners, more than 2000; simplify it" in block.faults[0].reason


def test_a_star_of_ten_thousand_corners_is_closed_to_its_disc(data: Path, tmp_path: Path) -> None:
    folder = data / "bad_inputs_2" / "buildings-10k-corners"
    if not folder.is_dir():
        pytest.skip("no bad inputs in the data folder")
    for file in folder.iterdir():
        shutil.copyfile(file, tmp_path / file.name)
    (tmp_path / "exemplars").unlink()
    shutil.copytree(data / "bad_inputs_2" / "exemplars", tmp_path / "exemplars", copy_function=shutil.copyfile)
    block = read_block(tmp_path / "block.yaml")
    (building,) = block.buildings
    assert shapely.get_num_coordinates(building.footprint) <= 2000
    assert building.footprint.area == pytest.approx(math.pi * 26**2, rel=0.02)
    assert "outlines of more than 2000 corners simplified: 1 (star)" in block.notes
