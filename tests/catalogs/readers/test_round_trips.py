"""What other programs write of a block is read as it was, whatever it holds: each format by the library that writes it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import geopandas
import networkx
import numpy as np
import pytest
import rasterio
import shapely
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import CRS
from rasterio.transform import from_origin
from shapely import LineString, Polygon

from catalogs.features import BuildingModel
from catalogs.readers.cityjson.buildings import read_cityjson
from catalogs.readers.meshes.models import read_mesh_buildings
from catalogs.readers.pictures.elevation import read_elevation
from catalogs.readers.vectors.graphml import read_graphml_centrelines
from catalogs.readers.vectors.vector_files import read_vector_centrelines, read_vector_footprints
from catalogs.readers.walls import read_footprints_from_walls
from facade_core.core.types import SEMANTICS
from facade_core.export.attribution import Attribution
from facade_core.export.bodies.model_face import ModelFace
from facade_core.export.city_models.cityjson import VertexPool, build_geometry, empty_document

EAST, NORTH = 385_000.0, 6_672_000.0
FRAME = "EPSG:3067"
VECTORS = (".gpkg", ".geojson", ".parquet", ".shp", ".fgb")
NOTHING = ("nan", "none", "null", "nat")  # words that say that a cell is empty

# In names of meshes a | parts the building from the surface.
words = st.text("abno19Zä中 .-_&<,;#:/\\()[]{}=%*+'\"", min_size=1, max_size=12).map(str.strip)
words = words.filter(lambda word: word and word.lower() not in NOTHING)
metres = st.floats(2.5, 500.0)


@st.composite
def outlines(draw: st.DrawFn, at: int) -> Polygon:
    """A star-shaped outline of 3 to 8 corners around its own place, with a hole or without."""
    count = draw(st.integers(3, 8))
    far = np.array(draw(st.lists(st.floats(5.0, 15.0), min_size=count, max_size=count)))
    angle = np.arange(count) * 2 * np.pi / count
    ring = far[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]) + (EAST + 40 * at, NORTH)
    hole = [Polygon(ring).centroid.buffer(0.5, quad_segs=1).exterior] if draw(st.booleans()) else []
    outline = Polygon(ring, hole)
    return outline if outline.is_valid else Polygon(ring)


@st.composite
def boxes(draw: st.DrawFn) -> list[tuple[np.ndarray, np.ndarray]]:
    """The centres and sizes of 1 to 4 boxes in metres, from west to east, each standing apart."""
    sizes = draw(st.lists(st.tuples(*[st.floats(1.0, 20.0)] * 3), min_size=1, max_size=4))
    shifts = draw(st.lists(st.floats(-5.0, 5.0), min_size=len(sizes), max_size=len(sizes)))
    return [
        (np.array([30.0 * i, shift, size[2] / 2]), np.array(size))
        for i, (size, shift) in enumerate(zip(sizes, shifts, strict=True))
    ]


def names_of(count: int) -> st.SearchStrategy[list[str]]:
    return st.lists(words, min_size=count, max_size=count, unique=True)


def write_table(path: Path, table: geopandas.GeoDataFrame) -> None:
    if path.suffix == ".geojson":  # GDAL would write a text such as {} as an object
        table.to_crs(4326).to_file(path, AUTODETECT_JSON_STRINGS="NO")
    else:
        table.to_parquet(path) if path.suffix == ".parquet" else table.to_file(path)


def in_metres(path: Path, geometries: Sequence[Any], crs: str | None) -> list[Any]:
    assert crs == ("EPSG:4326" if path.suffix == ".geojson" else FRAME)
    return list(geopandas.GeoSeries(list(geometries), crs=crs).to_crs(FRAME))


@pytest.mark.parametrize("suffix", VECTORS)
@settings(max_examples=8)
@given(data=st.data())
def test_footprints(tmp_path_factory: pytest.TempPathFactory, suffix: str, data: st.DataObject) -> None:
    path = tmp_path_factory.mktemp("vectors") / f"buildings{suffix}"
    count = data.draw(st.integers(1, 4))
    shapes = [data.draw(outlines(at)) for at in range(count)]
    ids = data.draw(names_of(count))
    columns: dict[str, list[Any]] = {
        "height": data.draw(st.lists(st.none() | metres, min_size=count, max_size=count)),
        "levels": data.draw(st.lists(st.none() | st.integers(1, 60), min_size=count, max_size=count)),
        "name": data.draw(st.lists(st.none() | words, min_size=count, max_size=count)),
    }
    columns = {name: values for name, values in columns.items() if any(value is not None for value in values)}
    grounds = data.draw(st.none() | st.lists(st.floats(0.5, 90.0), min_size=count, max_size=count))
    drawn = shapes if grounds is None else [shapely.force_3d(s, z) for s, z in zip(shapes, grounds, strict=True)]
    write_table(path, geopandas.GeoDataFrame({"id": ids} | columns, geometry=drawn, crs=FRAME))
    source = read_vector_footprints(path)
    assert not source.faults
    items = {item.id: item for item in source.items}  # FlatGeobuf orders by place
    assert items.keys() == set(ids)
    outlines_read = in_metres(path, [items[id].outline for id in ids], source.crs)
    for row, (id, shape) in enumerate(zip(ids, outlines_read, strict=True)):
        item = items[id]
        stated = {name: values[row] for name, values in columns.items()}
        assert shape.symmetric_difference(shapes[row]).area < 1e-5 * shapes[row].length * 100
        assert item.height == pytest.approx(stated.get("height"), abs=1e-6)
        assert item.levels == stated.get("levels")
        assert item.name == stated.get("name")
        assert item.base == (None if grounds is None else pytest.approx(grounds[row], abs=1e-6))
        assert item.roof is None


@pytest.mark.parametrize("suffix", VECTORS)
@settings(max_examples=6)
@given(data=st.data())
def test_centrelines(tmp_path_factory: pytest.TempPathFactory, suffix: str, data: st.DataObject) -> None:
    path = tmp_path_factory.mktemp("vectors") / f"streets{suffix}"
    count = data.draw(st.integers(1, 4))
    turns = st.lists(st.floats(-50.0, 50.0), min_size=2, max_size=6)
    lines = [
        LineString([(EAST + 20.0 * step, NORTH + 200.0 * at + y) for step, y in enumerate(data.draw(turns))])
        for at in range(count)
    ]
    ids = data.draw(names_of(count))
    names = data.draw(st.lists(st.none() | words, min_size=count, max_size=count))
    write_table(path, geopandas.GeoDataFrame({"id": ids, "name": names}, geometry=lines, crs=FRAME))
    source = read_vector_centrelines(path)
    assert not source.faults
    items = {item.id: item for item in source.items}
    assert {id: item.name for id, item in items.items()} == dict(zip(ids, names, strict=True))
    for line, found in zip(lines, in_metres(path, [items[id].line for id in ids], source.crs), strict=True):
        np.testing.assert_allclose(shapely.get_coordinates(found), shapely.get_coordinates(line), atol=0.02)


@settings(max_examples=20)
@given(st.data())
def test_street_graphs(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    """A graph as OSMnx writes it: edges with a geometry of their own or without, in one direction or both."""
    count = data.draw(st.integers(2, 6))
    xs = data.draw(st.lists(st.floats(-90.0, 90.0), min_size=count, max_size=count))
    places = [(EAST + x, NORTH + 30.0 * node) for node, x in enumerate(xs)]
    pairs = st.tuples(st.integers(0, count - 1), st.integers(0, count - 1)).filter(lambda pair: pair[0] < pair[1])
    edges = data.draw(st.lists(pairs, min_size=1, max_size=6, unique=True))
    graph = networkx.MultiDiGraph(crs="epsg:3067")
    graph.add_nodes_from((str(node), {"x": str(x), "y": str(y)}) for node, (x, y) in enumerate(places))
    expected = {}
    for number, (start, end) in enumerate(edges, 1):
        name = data.draw(st.none() | words)
        tags = {"osmid": str(number), "highway": "residential"} | ({} if name is None else {"name": name})
        bend = [] if data.draw(st.booleans()) else [(EAST + 200.0 + number, NORTH - number)]
        line = LineString([places[start], *bend, places[end]])
        shape = {"geometry": shapely.to_wkt(line, rounding_precision=-1)} if bend else {}
        graph.add_edge(str(start), str(end), **tags, **shape)
        if data.draw(st.booleans()):
            back = {"geometry": shapely.to_wkt(line.reverse(), rounding_precision=-1)} if bend else {}
            graph.add_edge(str(end), str(start), **tags, **back, reversed="True")
        expected[f"w{number}"] = (name, shapely.normalize(line))
    path = tmp_path_factory.mktemp("graph") / "streets.graphml"
    networkx.write_graphml(graph, path)
    source = read_graphml_centrelines(path)
    assert source.crs == FRAME
    assert not source.faults
    found = {item.id: (item.name, shapely.normalize(item.line)) for item in source.items}
    assert len(found) == len(source.items)
    assert {id: name for id, (name, _) in found.items()} == {id: name for id, (name, _) in expected.items()}
    for id, (_, line) in expected.items():
        assert shapely.equals_exact(found[id][1], line, tolerance=1e-6)


@settings(max_examples=20)
@given(st.data())
def test_walls_of_bodies(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    """Bodies on outlines without holes, each edge a wall: one may be missing, for the body closes itself."""
    count = data.draw(st.integers(1, 3))
    names = data.draw(names_of(count))
    stated, expected = {}, {}
    for at, name in enumerate(names):
        outline = shapely.orient_polygons(Polygon(data.draw(outlines(at)).exterior))
        low, high = data.draw(st.floats(-5.0, 50.0)), data.draw(metres)
        corners = np.asarray(outline.exterior.coords)
        walls = [
            [[*a, low + high], [*b, low + high], [*b, low], [*a, low]]
            for a, b in zip(corners[:-1].tolist(), corners[1:].tolist(), strict=True)
        ]
        if len(walls) > 3 and data.draw(st.booleans()):
            walls.pop()
        stated[name] = {f"w{i}": wall for i, wall in enumerate(walls)}
        expected[name] = (outline, low, high)
    path = tmp_path_factory.mktemp("walls") / "walls.json"
    path.write_text(json.dumps({"crs": FRAME, "walls": stated}))
    source = read_footprints_from_walls(path)
    assert source.crs == FRAME
    assert not source.faults
    assert [item.id for item in source.items] == names
    for item in source.items:
        outline, low, high = expected[item.id]
        assert item.outline.symmetric_difference(outline).area < 1e-6
        assert (item.base, item.height) == (pytest.approx(low), pytest.approx(high))


def write_meshes(path: Path, names: Sequence[str], parts: Sequence[trimesh.Trimesh]) -> None:
    if path.suffix == ".npz":
        feature = np.repeat(np.arange(len(parts)), [len(part.faces) for part in parts])
        np.savez_compressed(path, triangles=np.concatenate([p.triangles for p in parts]), feature=feature, epsg=3067)
    elif path.suffix == ".ply":
        trimesh.util.concatenate(list(parts)).export(path)
    else:
        scene = trimesh.Scene()
        for name, part in zip(names, parts, strict=True):
            shown = part.copy()
            if path.suffix == ".glb":  # whose y is up
                shown.vertices = shown.vertices[:, [0, 2, 1]] * (1, 1, -1)
            scene.add_geometry(shown, node_name=name, geom_name=name)
        scene.export(path)


def check_box(model: BuildingModel, centre: np.ndarray, size: np.ndarray) -> None:
    shell = model.shell
    np.testing.assert_allclose(shell.vertices.min(axis=0), centre - size / 2, atol=1e-4)
    np.testing.assert_allclose(shell.vertices.max(axis=0), centre + size / 2, atol=1e-4)
    corners = shell.vertices[shell.triangles] - centre
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert volume == pytest.approx(size.prod(), rel=1e-3), "closed, and seen from outside"


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".glb", ".npz"])
@settings(max_examples=10)
@given(places=boxes(), data=st.data())
def test_meshes(
    tmp_path_factory: pytest.TempPathFactory,
    suffix: str,
    places: list[tuple[np.ndarray, np.ndarray]],
    data: st.DataObject,
) -> None:
    path = tmp_path_factory.mktemp("meshes") / f"city{suffix}"
    ids = data.draw(names_of(len(places)))
    parts = []
    for centre, size in places:
        part = trimesh.creation.box(size)
        part.apply_translation(centre)
        parts.append(part)
    write_meshes(path, ids, parts)
    source = read_mesh_buildings(path)
    assert not source.faults
    assert source.crs == (FRAME if suffix == ".npz" else None)
    found = sorted(source.items, key=lambda model: float(model.shell.vertices[:, 0].mean()))
    if len(found) > 1 and suffix in (".obj", ".glb"):
        assert [model.id for model in found] == ids
    assert len(found) == len(places)
    for model, place in zip(found, places, strict=True):
        check_box(model, *place)


@settings(max_examples=20)
@given(st.data())
def test_cityjson_of_our_own(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    """Bodies on outlines with holes, as the export writes them: surfaces and what each is come back to the millimetre."""
    path = tmp_path_factory.mktemp("cityjson") / "block.city.json"
    count = data.draw(st.integers(1, 3))
    names = data.draw(names_of(count))
    pool = VertexPool(np.array([EAST, NORTH, 0.0]) + data.draw(st.integers(-100, 100)))
    city = empty_document("block", pool.origin, "https://www.opengis.net/def/crs/EPSG/0/3067", Attribution(()))
    expected = {}
    for at, name in enumerate(names):
        outline = shapely.orient_polygons(shapely.set_precision(data.draw(outlines(at)), 0.001))
        low, high = data.draw(st.integers(-5, 50)), data.draw(st.integers(3, 90))
        plan = [np.asarray(ring.coords)[:-1] for ring in (outline.exterior, *outline.interiors)]

        def level(z: float, *, up: bool, plan: list[np.ndarray] = plan) -> tuple[np.ndarray, ...]:
            return tuple(np.column_stack([ring, np.full(len(ring), z)])[:: 1 if up else -1] for ring in plan)

        faces = [ModelFace(level(low + high, up=True), 1), ModelFace(level(low, up=False), 2)]
        for ring in plan:
            for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
                wall = np.array([[*a, low], [*b, low], [*b, low + high], [*a, low + high]])
                faces.append(ModelFace((wall,), 0))
        surfaces = [{"type": kind} for kind in ("WallSurface", "RoofSurface", "GroundSurface")]
        attributes = {"measuredHeight": high, "name": f"Hall {at}", "storeysAboveGround": at + 1}
        geometry = build_geometry(faces, surfaces, pool, "2")
        city["CityObjects"][name] = {"type": "Building", "attributes": attributes, "geometry": [geometry]}
        expected[name] = (outline, low, high)
    city |= pool.tables([])
    path.write_text(json.dumps(city))
    source = read_cityjson(path)
    assert source.crs == FRAME
    assert not source.faults
    assert [model.id for model in source.items] == names
    for at, model in enumerate(source.items):
        outline, low, high = expected[model.id]
        assert (model.name, model.height, model.levels) == (f"Hall {at}", high, at + 1)
        corners = model.shell.vertices[model.shell.triangles]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
        areas = {
            kind: np.linalg.norm(across[model.shell.semantic == SEMANTICS.index(kind)], axis=1).sum()
            for kind in ("wall", "roof", "ground")
        }
        assert areas["roof"] == pytest.approx(outline.area, abs=1e-6)
        assert areas["ground"] == pytest.approx(outline.area, abs=1e-6)
        assert areas["wall"] == pytest.approx(outline.length * high, abs=1e-6)
        np.testing.assert_allclose(across.sum(axis=0), 0, atol=1e-6, err_msg="closed, and seen from outside")
        np.testing.assert_allclose(np.unique(model.shell.vertices[:, 2]), [low, low + high], atol=1e-9)


@pytest.mark.parametrize("virtual", [False, True])
@settings(max_examples=6)
@given(
    seed=st.integers(0, 2**32 - 1),
    step=st.sampled_from([1.0, 2.0, 5.0]),
    kind=st.sampled_from(["float32", "float64", "int16"]),
    unknown=st.floats(0, 0.3),
)
def test_elevation(
    tmp_path_factory: pytest.TempPathFactory, virtual: bool, seed: int, step: float, kind: str, unknown: float
) -> None:
    """Heights of a GeoTIFF, and of a virtual raster of two that lie side by side."""
    folder = tmp_path_factory.mktemp("elevation")
    rng = np.random.default_rng(seed)
    side = 40
    heights = np.round(rng.uniform(450, 456, (side, 2 * side)), 2).astype(kind)
    heights[rng.random(heights.shape) < unknown] = -9999
    for name, part in (("west", heights[:, :side]), ("east", heights[:, side:]), ("whole", heights)):
        west = EAST + (side * step if name == "east" else 0)
        profile = {"crs": FRAME, "transform": from_origin(west, NORTH, step, step), "dtype": kind, "nodata": -9999}
        height, width = part.shape
        with rasterio.open(folder / f"{name}.tif", "w", "GTiff", width, height, 1, **profile) as raster:
            raster.write(part, 1)
    sources = "".join(
        f'<ComplexSource><SourceFilename relativeToVRT="1">{name}.tif</SourceFilename><SourceBand>1</SourceBand>'
        f'<SrcRect xOff="0" yOff="0" xSize="{side}" ySize="{side}"/>'
        f'<DstRect xOff="{at}" yOff="0" xSize="{side}" ySize="{side}"/><NODATA>-9999</NODATA></ComplexSource>'
        for name, at in (("west", 0), ("east", side))
    )
    (folder / "both.vrt").write_text(
        f'<VRTDataset rasterXSize="{2 * side}" rasterYSize="{side}"><SRS>{FRAME}</SRS>'
        f"<GeoTransform>{EAST}, {step}, 0, {NORTH}, 0, {-step}</GeoTransform>"
        f'<VRTRasterBand dataType="{kind.capitalize()}" band="1"><NoDataValue>-9999</NoDataValue>{sources}'
        "</VRTRasterBand></VRTDataset>"
    )
    bounds = (EAST + 10 * step, NORTH - 30 * step, EAST + 70 * step, NORTH - 10 * step)
    found = read_elevation(folder / ("both.vrt" if virtual else "whole.tif"), CRS(FRAME), bounds)
    assert found.step == step
    column, row = round((found.x - EAST) / step - 0.5), round((NORTH - found.y) / step - 0.5)
    rows, columns = found.heights.shape
    there = heights[row : row + rows, column : column + columns].astype(np.float64)
    np.testing.assert_allclose(found.heights, np.where(there == -9999, np.nan, there), atol=1e-3)
