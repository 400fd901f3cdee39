"""Solids of vector files."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Sequence
from pathlib import Path

import geopandas
import numpy as np
import pytest
import shapely
from shapely import MultiPolygon, Polygon

from catalogs.block.reader import Block, read_block
from catalogs.readers.vectors.solids import build_solid, convert_surface_wkb
from catalogs.readers.vectors.vector_files import read_vector_footprints
from facade_core.core.types import Building

EAST, NORTH = 385_000.0, 6_671_000.0
Ring = Sequence[tuple[float, float, float]]


def box_faces(x: float, height: float, base: float = 10.0) -> list[Ring]:
    """Return the six outward faces of a box of 14 x 9 m."""
    plan = [(EAST + x, NORTH), (EAST + x + 14, NORTH), (EAST + x + 14, NORTH + 9), (EAST + x, NORTH + 9)]
    low, high = [(*place, base) for place in plan], [(*place, base + height) for place in plan]
    walls = [[low[i], low[(i + 1) % 4], high[(i + 1) % 4], high[i]] for i in range(4)]
    return [low[::-1], high, *walls]


def solid(x: float, height: float) -> MultiPolygon:
    return MultiPolygon([Polygon(face) for face in box_faces(x, height)])


def surface_wkb(faces: Sequence[Ring], kind: int, part: int) -> bytes:
    """Return a surface of ISO type `kind` of parts of type `part`."""
    rings = [[*face, face[0]] for face in faces]
    parts = [
        struct.pack("<BIII", 1, part, 1, len(ring)) + b"".join(struct.pack("<3d", *place) for place in ring)
        for ring in rings
    ]
    return struct.pack("<BII", 1, kind, len(parts)) + b"".join(parts)


def triangles(faces: Sequence[Ring]) -> list[Ring]:
    return [tri for a, b, c, d in faces for tri in ([a, b, c], [a, c, d])]


def read_buildings_of(folder: Path, name: str) -> Block:
    block = {"name": "b", "crs": "EPSG:32635", "buildings": {"path": name}, "texture": {"walls": "translate"}}
    (folder / "block.yaml").write_text(json.dumps(block))
    return read_block(folder / "block.yaml")


def volume(building: Building) -> float:
    assert building.shell is not None
    corners = building.shell.vertices[building.shell.triangles] - building.shell.vertices[0]
    return float(np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6)


@pytest.mark.parametrize("suffix", [".gpkg", ".geojson", ".parquet", ".fgb"])
def test_multipolygons_with_walls_are_models_and_others_outlines(tmp_path: Path, suffix: str) -> None:
    import geopandas

    flat = Polygon([(*place[:2], 10.0) for place in box_faces(60, 5)[1]])
    table = geopandas.GeoDataFrame(
        {"id": ["a", "b", "c"], "height": [None, None, 5.0], "roof_shape": ["flat"] * 3},
        geometry=[solid(0, 9), solid(30, 30), MultiPolygon([flat])],
        crs="EPSG:32635",
    )
    if suffix == ".parquet":
        table.to_parquet(tmp_path / "b.parquet")
    elif suffix == ".geojson":
        table.to_crs(4326).to_file(tmp_path / "b.geojson")
    else:
        table.to_file(tmp_path / f"b{suffix}")
    buildings = read_buildings_of(tmp_path, f"b{suffix}").buildings
    found = {one.id: one for one in buildings}
    assert [(id, one.height_source) for id, one in sorted(found.items())] == [
        ("a", "model"),
        ("b", "model"),
        ("c", "height"),
    ]
    assert [round(found[id].height, 2) for id in "abc"] == [9, 30, 5]
    assert [found[id].base for id in "abc"] == [10, 10, 10]
    assert volume(found["b"]) == pytest.approx(14 * 9 * 30, rel=1e-3)


@pytest.mark.parametrize("suffix", ["gpkg", "shp"])
@pytest.mark.parametrize(("kind", "part"), [(1015, 1003), (1016, 1017)])
@pytest.mark.filterwarnings("ignore:Registering non-standard")
def test_polyhedral_surfaces_and_tins_are_models(tmp_path: Path, suffix: str, kind: int, part: int) -> None:
    import pyogrio

    faces = box_faces(0, 30)
    wkb = np.array([surface_wkb(triangles(faces) if kind == 1016 else faces, kind, part)], object)
    ids = [np.array(["a"], object)]
    pyogrio.raw.write(tmp_path / f"b.{suffix}", wkb, ids, ["id"], geometry_type="Unknown", crs="EPSG:32635")
    (building,) = read_buildings_of(tmp_path, f"b.{suffix}").buildings
    assert (building.id, building.height, building.base) == ("a", 30, 10)


@pytest.mark.parametrize("turned", [slice(0, 6), slice(1, 3)])
def test_faces_are_turned_outwards(turned: slice) -> None:
    faces = box_faces(0, 9)
    faces[turned] = [face[::-1] for face in faces[turned]]
    shell = build_solid(MultiPolygon([Polygon(face) for face in faces]), is_lonlat=False)
    assert shell is not None
    assert volume(Building("a", Polygon(), 9.0, "model", shell=shell)) == pytest.approx(14 * 9 * 9)


def test_outlines_are_no_solids() -> None:
    level = MultiPolygon([Polygon(box_faces(x, 9)[1]) for x in (0, 20, 40, 60)])
    terrain = MultiPolygon([Polygon([(x, 0, 0), (x + 9, 0, 3), (x, 9, 2)]) for x in range(0, 50, 10)])
    assert build_solid(level, is_lonlat=False) is None
    assert build_solid(terrain, is_lonlat=False) is None
    assert build_solid(Polygon([(0, 0), (1, 0), (1, 1)]), is_lonlat=False) is None


def test_broken_wkb_is_no_surface() -> None:
    wkb = surface_wkb(box_faces(0, 9), 1015, 1003)
    converted = convert_surface_wkb(wkb)
    assert converted is not None
    assert math.isclose(shapely.from_wkb(converted).area, 2 * 14 * 9)
    assert convert_surface_wkb(wkb[:-9]) is None
    assert convert_surface_wkb(b"\x01\xf7\x03\x00\x00\xff\xff\xff\xff") is None


def test_walls_without_floor_and_roof_are_called_that(tmp_path: Path) -> None:
    walls = MultiPolygon([Polygon(face) for face in box_faces(20, 12)[2:]])
    table = geopandas.GeoDataFrame({"id": ["whole", "open"]}, geometry=[solid(0, 12), walls], crs="EPSG:3067")
    table.to_file(tmp_path / "b.gpkg")
    found = read_vector_footprints(tmp_path / "b.gpkg")
    assert [one.id for one in found.items] == ["whole"]
    assert [(one.id, one.reason) for one in found.remarks if "walls" in one.reason] == [
        ("open", "buildings of walls without floor and roof set aside; export closed solids, or outlines with heights")
    ]
    assert not [one for one in found.remarks if "empty" in one.reason]
