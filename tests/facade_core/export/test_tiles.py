"""3D Tiles stand where the block does, coarse above fine, and never untextured."""

from __future__ import annotations

import io
import posixpath
import sys
from collections.abc import Callable
from itertools import pairwise, zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from pyproj import Transformer

from facade_core.core.errors import InputError
from facade_core.core.street_objects import OBJECT_KIND_NAMES, PlacedObjects
from facade_core.core.surrounding_mesh import SurroundingMaterial, SurroundingMesh
from facade_core.core.types import Element
from facade_core.export.attribution import Attribution, DataSource
from facade_core.export.bodies.textured_relief import add_relief
from facade_core.export.lighting.relighting import build_relightable_mesh
from facade_core.export.models.encoders import MIPMAP_FACTOR, texture_encoder
from facade_core.export.models.features import FeatureTable, MetadataProperty
from facade_core.export.models.glb import extract_images, read_glb_header
from facade_core.export.models.gltf_materials import TimeOfDay
from facade_core.export.models.textured_mesh import TexturedMesh, mesh_y_up_frame
from facade_core.export.surroundings.gltf import SurroundingModel
from facade_core.export.tiles.cells import build_quadtree
from facade_core.export.tiles.earth import ProjectedFrame, earth_tangent_frame
from facade_core.export.tiles.far_shells import build_shells
from facade_core.export.tiles.settings import TILE_CELLS, CellSettings
from facade_core.export.tiles.tileset import (
    TiledModel,
    TilesetSummary,
    TileSettings,
    count_tiles,
    view_texture_scale,
    write_tileset,
)
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.scene import Scene
from tests.facade_core.export.conftest import colour_of
from tests.facade_core.export.test_lit import lighting

CRS = "EPSG:32635"
OF = Attribution((DataSource("buildings.path", "a.pbf", "Mappers, ODbL 1.0"),))


@pytest.mark.parametrize("crs", [CRS, "EPSG:28992"])
def test_the_frame_puts_points_where_they_are_on_the_earth(crs: str) -> None:
    origin = np.array([386000.0, 6672000.0, 5.0] if crs == CRS else [92000.0, 436000.0, -1.0])
    frame = earth_tangent_frame(crs, origin, 17.5)
    world = origin + np.array([[0, 0, 0], [800, -300, 40], [0, 1000, 0]])
    model = frame.points(world)
    matrix = frame.transform()
    tile = np.column_stack([model[:, 0], -model[:, 2], model[:, 1]])  # as a viewer turns glTF's y up
    earth = tile @ matrix[:3, :3].T + matrix[:3, 3]
    longitude, latitude, height = Transformer.from_crs("EPSG:4978", "EPSG:4979", always_xy=True).transform(*earth.T)
    expected = Transformer.from_crs(crs, "EPSG:4326", always_xy=True).transform(world[:, 0], world[:, 1])
    np.testing.assert_allclose([longitude, latitude], expected, atol=1e-9)
    np.testing.assert_allclose(height, world[:, 2] + 17.5, atol=1e-4)
    np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-12)
    north = frame.directions(np.array([[0.0, 1.0, 0.0]]))[0]
    np.testing.assert_allclose(north, (model[2] - model[0]) / np.linalg.norm(model[2] - model[0]), atol=1e-3)


def test_the_projected_frame_keeps_coordinates_and_directions_of_the_block() -> None:
    origin = np.array([92000.0, 436000.0, -1.0])
    frame = ProjectedFrame(origin)
    world = origin + np.array([[0, 0, 0], [800, -300, 40], [0, 1000, 0]])
    matrix = frame.transform()
    placed = frame.points(world)[:, [0, 2, 1]] * [1, -1, 1] @ matrix[:3, :3].T + matrix[:3, 3]
    np.testing.assert_array_equal(placed, world)
    north = frame.directions(np.array([[0.0, 1.0, 0.0]]))[0]
    np.testing.assert_array_equal(north, [0, 0, -1])


def test_shells_look_like_their_buildings(coloured: TexturedMesh) -> None:
    shells = build_shells(coloured, 2.5)
    shown = shells.textured_mesh
    assert shells.without_shell.size == 0
    assert (np.bincount(shown.charts.kind, minlength=2)[[ChartKind.WALL, ChartKind.ROOF]] == [8, 2]).all()
    for chart in range(len(shown.charts)):
        raster = shown.raster(chart).astype(int)
        assert raster.shape[:2] == tuple(shown.texels[chart][::-1])
        point = shown.centres[chart]
        same = np.flatnonzero(
            (coloured.charts.building == shown.charts.building[chart])
            & (coloured.charts.kind == shown.charts.kind[chart])
        )
        nearest = same[np.linalg.norm(coloured.centres[same] - point, axis=1).argmin()]
        assert np.abs(raster - colour_of(nearest)).max() <= 1


COLUMNS = (MetadataProperty("id", "string", "", "which"), MetadataProperty("floors", "int32", "", "storeys"))


def features(source: TexturedMesh) -> FeatureTable:
    """A row for every chart, and one for every building."""
    charts = len(source.charts)
    rows = [{"id": f"chart-{chart}", "floors": chart} for chart in range(charts)]
    rows += [{"id": name} for name in "ab"]
    own = np.arange(charts)
    return FeatureTable(COLUMNS, rows, own, np.where(source.charts.building >= 0, charts + source.charts.building, own))


def written(
    source: TexturedMesh,
    scale: float = 1.0,
    textures: str = "jpeg",
    time: TimeOfDay = "day",
    settings: CellSettings = TILE_CELLS,
    finest: TexturedMesh | None = None,
    around: tuple[PlacedObjects, SurroundingMesh] | None = None,
) -> tuple[TilesetSummary, dict[str, bytes], int]:
    files: dict[str, bytes] = {}
    cells = build_quadtree(source, settings)
    shells = build_shells(source, 10 * settings.coarse_scale)
    frame = earth_tangent_frame(CRS, mesh_y_up_frame(source.mesh).origin)
    made = write_tileset(
        TiledModel(
            source,
            shells,
            frame,
            features(source),
            finest,
            around and SurroundingModel(*around, frame, is_instanced=True),
        ),
        cells,
        TileSettings(texture_encoder(textures), scale, time),
        files.__setitem__,
        extras={"k": 1},
        attribution=OF,
    )
    return made, files, count_tiles(cells)


def table_of(glb: bytes) -> list[dict[str, Any]]:
    """The rows of a tile's property table."""
    document, start = read_glb_header(io.BytesIO(glb))
    metadata = document["extensions"]["EXT_structural_metadata"]
    (table,) = metadata["propertyTables"]

    def view(number: int) -> bytes:
        one = document["bufferViews"][number]
        assert (start + one["byteOffset"]) % 8 == 0
        return glb[start + one["byteOffset"] : start + one["byteOffset"] + one["byteLength"]]

    offsets = np.frombuffer(view(table["properties"]["id"]["stringOffsets"]), "<u4")
    text = view(table["properties"]["id"]["values"])
    ids = [text[a:b].decode() for a, b in pairwise(offsets.tolist())]
    floors = (
        np.frombuffer(view(table["properties"]["floors"]["values"]), "<i4") if "floors" in table["properties"] else []
    )
    assert table["count"] == len(ids)
    return [{"id": id, "floors": n} for id, n in zip_longest(ids, floors)]


def drawn_ids(glb: bytes) -> set[str]:
    """The ids that a tile's vertices name."""
    document, start = read_glb_header(io.BytesIO(glb))
    rows = table_of(glb)
    found = set()
    for primitive in document["meshes"][0]["primitives"]:
        accessor = document["accessors"][primitive["attributes"]["_FEATURE_ID_0"]]
        view = document["bufferViews"][accessor["bufferView"]]
        data = np.frombuffer(glb, "<u2", accessor["count"] * 2, start + view["byteOffset"])[::2]
        found |= {rows[row]["id"] for row in np.unique(data).tolist()}
    return found


def count_triangles(glb: bytes) -> int:
    document, _ = read_glb_header(io.BytesIO(glb))
    return sum(document["accessors"][p["indices"]]["count"] // 3 for p in document["meshes"][0]["primitives"])


def test_only_the_finest_tiles_have_relief_and_coarse_ones_state_its_depth(coloured: TexturedMesh) -> None:
    charts = coloured.charts
    walls = np.flatnonzero((charts.building == 0) & (charts.kind == ChartKind.WALL))
    wall = int(walls[np.argmax(charts.size[walls, 0])])
    deep = add_relief(coloured, {wall: [Element("window", 1, 2, 2.5, 4), Element("balcony", 4, 3, 7, 4)]})
    assert deep.max_offset_m == pytest.approx(0.9, abs=0.01)
    for scale in (1.0, 4.0):
        _, flat, _ = written(coloured, scale)
        made, files, _ = written(coloured, scale, finest=deep)
        assert flat.keys() == files.keys()
        for uri, glb in files.items():
            more = count_triangles(glb) - count_triangles(flat[uri])
            assert more == (len(deep.mesh.triangles) - len(coloured.mesh.triangles) if "full" in uri else 0)
        root = made.tilesets["tileset.json"]["root"]
        assert root["geometricError"] >= deep.max_offset_m


def test_objects_are_added_to_all_tiles_and_neighbours_are_a_tileset_of_their_own(coloured: TexturedMesh) -> None:
    low, high = coloured.mesh.vertices.min(axis=0), coloured.mesh.vertices.max(axis=0)
    lamp = PlacedObjects(
        ("n1",),
        np.array([OBJECT_KIND_NAMES.index("street_lamp")], np.int32),
        np.zeros(1, np.int32),
        np.array([(low + high) / 2]),
        np.zeros(1),
        np.array([[0.5, 1.6, 6.0]]),
        np.ones(1, bool),
    )
    far = low + np.array([[0.0, 0.0, 0.0], [900.0, 0.0, 0.0], [0.0, 900.0, 0.0]])
    wall = np.full(3, SurroundingMaterial.WALL, np.uint8)
    up, grey = np.tile([0.0, 0.0, 1.0], (3, 1)), np.zeros((3, 3), np.uint8)
    around = SurroundingMesh(far, up, wall, grey, np.zeros(3, np.int64), np.array([[0, 1, 2]], np.int32))
    plain, bare, _ = written(coloured)
    made, files, _ = written(coloured, around=(lamp, around))
    assert files.keys() - bare.keys() == {"tiles/objects.glb", "surroundings.glb"}
    alone, whole = plain.tilesets["tileset.json"], made.tilesets["tileset.json"]
    assert whole["asset"]["extras"]["surroundings"] == "surroundings.json"
    root = whole["root"]
    first, objects = root["children"]
    assert {**first, "transform": root["transform"]} == alone["root"]
    assert objects["content"]["uri"] == "tiles/objects.glb"
    assert (root["refine"], "content" in root) == ("ADD", False)
    assert whole["geometricError"] == root["geometricError"] == pytest.approx(alone["geometricError"])
    assert root["boundingVolume"]["box"] == pytest.approx(alone["root"]["boundingVolume"]["box"]), "no wider"
    other = made.tilesets["surroundings.json"]
    assert other["root"]["transform"] == root["transform"]
    assert other["root"]["content"]["uri"] == "surroundings.glb"
    assert other["root"]["boundingVolume"]["box"][3] == pytest.approx(450.0, rel=0.05)
    assert made.draw_calls == plain.draw_calls + 2


@pytest.mark.parametrize("texels", [TILE_CELLS.max_coarse_tile_texels, 60_000, 3_000])
def test_tiles_nest_and_hold_every_building_at_both_levels(coloured: TexturedMesh, texels: int) -> None:
    made, files, counted = written(coloured, settings=CellSettings(max_coarse_tile_texels=texels))
    value = made.tilesets["tileset.json"]
    assert value["asset"]["version"] == "1.1"
    assert value["asset"]["extras"] == {"k": 1, "attribution": OF.to_json()}
    assert len(value["root"]["transform"]) == 16
    finest: list[str] = []
    seen: list[str] = []
    primitives = 0

    def check(tile: dict[str, Any], place: str, error: float, around: np.ndarray | None) -> set[str]:
        """What of the block a tile and all below it show."""
        nonlocal primitives
        assert tile["geometricError"] <= error
        uri = posixpath.normpath(posixpath.join(place, tile["content"]["uri"]))
        if uri.endswith(".json"):
            assert "children" not in tile
            return check(made.tilesets[uri]["root"], posixpath.dirname(uri), tile["geometricError"], around)
        seen.append(uri)
        box = np.array(tile["boundingVolume"]["box"])
        corners = np.stack([box[:3] - box[[3, 7, 11]], box[:3] + box[[3, 7, 11]]])
        document = read_glb_header(io.BytesIO(files[uri]))[0]
        assert document["asset"]["copyright"] == OF.line
        drawn = document["meshes"][0]["primitives"]
        assert len(drawn) == len(document["images"]), "one draw call a picture"
        primitives += len(drawn)
        node = document["nodes"][0]
        for primitive in drawn:
            place_of = document["accessors"][primitive["attributes"]["POSITION"]]
            ends = [np.array(place_of[end]) * node["scale"] + node["translation"] for end in ("min", "max")]
            low, high = np.array(ends)[:, [0, 2, 1]] * [1, -1, 1]
            assert (np.minimum(low, high) >= corners[0] - 2e-3).all()
            assert (np.maximum(low, high) <= corners[1] + 2e-3).all()
        if around is not None:
            assert (corners[0] >= around[0] - 1e-6).all()
            assert (corners[1] <= around[1] + 1e-6).all()
        own = {owner_of(id) for id in drawn_ids(files[uri])}
        if "children" not in tile:
            finest.extend(sorted(own))
            assert tile["geometricError"] == 0
            return own
        within = [check(child, place, tile["geometricError"], corners) for child in tile["children"]]
        assert own == set().union(*within), "what replaces a tile shows the same of the block: no holes"
        return own

    def owner_of(id: str) -> str:
        if not id.startswith("chart-"):
            return id
        chart = int(id.removeprefix("chart-"))
        building = int(coloured.charts.building[chart])
        return "ab"[building] if building >= 0 else id

    check(value["root"], "", value["geometricError"], None)
    assert sorted(seen) == sorted(files)
    assert len(files) == counted >= 2
    assert sum(map(len, files.values())) == made.bytes
    assert primitives == made.draw_calls
    assert sorted(name for name in finest if name in "ab") == ["a", "b"], "each building in one finest tile"
    assert 0 < made.used_texels < made.page_texels


def test_every_chart_answers_with_its_row_and_keeps_its_colour(coloured: TexturedMesh) -> None:
    _, files, _ = written(coloured)
    glb = files["tiles/full.glb"]
    document, start = read_glb_header(io.BytesIO(glb))
    rows = table_of(glb)
    node = document["nodes"][0]

    def accessor(number: int, kind: str, width: int, stride: int) -> np.ndarray:
        one = document["accessors"][number]
        at = start + document["bufferViews"][one["bufferView"]]["byteOffset"]
        size = np.dtype(kind).itemsize
        return np.frombuffer(glb, kind, one["count"] * stride // size, at).reshape(one["count"], -1)[:, :width]

    checked = set()
    images = extract_images(glb)
    for primitive in document["meshes"][0]["primitives"]:
        image = np.asarray(Image.open(io.BytesIO(images[primitive["material"]]))).astype(int)
        attributes = primitive["attributes"]
        uv = accessor(attributes["TEXCOORD_0"], "<u2", 2, 4) / 65535
        ids = accessor(attributes["_FEATURE_ID_0"], "<u2", 1, 4)[:, 0]
        position = accessor(attributes["POSITION"], "<u2", 3, 8) * node["scale"] + node["translation"]
        assert np.isfinite(position).all()
        triangles = accessor(primitive["indices"], "<u2", 1, 2).reshape(-1, 3)
        assert len(triangles) * 3 == document["accessors"][primitive["indices"]]["count"]
        for triangle in triangles:
            chart = rows[ids[triangle[0]]]["floors"]
            assert len(set(ids[triangle].tolist())) == 1
            x, y = (uv[triangle].mean(axis=0) * image.shape[1::-1]).astype(int)
            assert np.abs(image[y, x] - colour_of(chart)).max() < 14, "JPEG's error at most"
            checked.add(chart)
    assert checked == set(np.unique(coloured.mesh.chart).tolist())


def fitting(source: TexturedMesh, most: float, time: TimeOfDay = "day") -> float:
    shells = build_shells(source, 10 * TILE_CELLS.coarse_scale)
    return view_texture_scale(source, shells, build_quadtree(source), texture_encoder("jpeg"), most, time)


def test_a_view_takes_no_more_of_a_graphics_card_than_asked(coloured: TexturedMesh) -> None:
    whole = written(coloured)[0].page_texels * 4 * MIPMAP_FACTOR
    assert fitting(coloured, whole) == 1.0, "coarse tiles are counted, and nothing else"
    assert fitting(coloured, whole - 1) < 1
    scale = fitting(coloured, whole / 3)
    assert 0.25 < scale < 1
    assert whole / 6 < written(coloured, scale)[0].page_texels * 4 * MIPMAP_FACTOR <= whole / 3


def test_tiles_are_valid(coloured: TexturedMesh, gltf_issues: Callable[..., list[dict]], tmp_path: Path) -> None:
    _, files, _ = written(coloured)
    for uri, data in files.items():
        (tmp_path / posixpath.basename(uri)).write_bytes(data)
    for issues in gltf_issues(*sorted(tmp_path.glob("*.glb"))):
        assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), issues["messages"][:3]


# What Khronos' validator says of pictures that it does not know.
OF_KTX2 = {"IMAGE_UNRECOGNIZED_FORMAT", "VALUE_NOT_IN_LIST"}


@pytest.mark.parametrize("textures", ["jpeg", "webp", "ktx2"])
def test_lit_tiles_are_valid_and_shine_from_afar_too(
    houses: Scene, coloured: TexturedMesh, gltf_issues: Callable[..., list[dict]], tmp_path: Path, textures: str
) -> None:
    if textures == "ktx2":
        pytest.importorskip("alktx2", reason="no encoder of KTX2; `make ktx2-setup` installs it")
    _, files, _ = written(build_relightable_mesh(coloured, lighting(houses, None)), textures=textures, time="night")
    for uri, data in files.items():
        (tmp_path / posixpath.basename(uri)).write_bytes(data)
        said, start = read_glb_header(io.BytesIO(data))
        assert any("emissiveTexture" in one for one in said["materials"]), "windows of shells too"
        assert all("TANGENT" in one["attributes"] for one in said["meshes"][0]["primitives"])
        if textures == "ktx2":
            continue
        views = [said["bufferViews"][one["bufferView"]] for one in said["images"]]
        sizes = [Image.open(io.BytesIO(data[start + one["byteOffset"] :][: one["byteLength"]])).size for one in views]
        assert all(side & (side - 1) == 0 for size in sizes for side in size), "powers of two"
        for material in said["materials"]:
            colour = material["pbrMetallicRoughness"]["baseColorTexture"]["index"]
            normal = material["normalTexture"]["index"]
            assert [side // 2 for side in sizes[colour]] == list(sizes[normal])
    for issues in gltf_issues(*sorted(tmp_path.glob("*.glb"))):
        assert issues["numErrors"] == 0, issues["messages"][:3]
        assert {one["code"] for one in issues["messages"] if one["severity"] < 2} <= (
            OF_KTX2 if textures == "ktx2" else set()
        )


def test_maps_count_for_what_a_view_takes(houses: Scene, coloured: TexturedMesh) -> None:
    most = written(coloured)[0].page_texels * 4 * MIPMAP_FACTOR
    assert fitting(coloured, most) == 1
    source = build_relightable_mesh(coloured, lighting(houses, None))
    day, night = (fitting(source, most, time) for time in ("day", "night"))
    assert night <= day < 1


def test_an_encoder_that_is_absent_is_named_with_what_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "alktx2", None)
    with pytest.raises(InputError, match=r"--textures ktx2: .* `make ktx2-setup`"):
        texture_encoder("ktx2")


def test_webp_is_read_again() -> None:
    image = np.full((64, 32, 3), (10, 200, 90), np.uint8)
    with Image.open(io.BytesIO(texture_encoder("webp").encode(image))) as again:
        assert again.format == "WEBP"
        assert np.abs(np.asarray(again.convert("RGB")).astype(int) - image).max() < 6
