"""Exports of a whole published run, as a user types them."""

from __future__ import annotations

import inspect
import json
import os
import re
import shutil
import sqlite3
from contextlib import closing
from dataclasses import replace
from glob import glob
from pathlib import Path
from typing import Any, cast

import click.testing
import geopandas as gpd
import numpy as np
import pyarrow.parquet as pq
import pyogrio
import pytest
import shapely
import trimesh
from PIL import Image
from pyproj import Transformer

from catalogs.published.columns import COLUMNS
from catalogs.published.map_layers import LAYER_NAMES
from facade_core.core.errors import InputError, StoreError
from facade_core.export.models.glb import read_glb_header
from flows.cli.commands import command_line
from tasks.export.formats import export_run
from tasks.export.models import write_3dtiles
from tasks.export.registry import FORMATS
from tasks.export.targets import marker_name
from tasks.publish.published_run import PublishedBlock
from tests.exports import HERE

Run = tuple[Path, dict[str, Any]]


def test_each_option_is_one_of_the_command_and_of_the_export() -> None:
    offered = {option.name for option in command_line.commands["export"].params}
    for entry in FORMATS.values():
        assert {*entry.options, *entry.factored_options} <= offered & inspect.signature(export_run).parameters.keys()


@pytest.mark.long
def test_every_format_by_command(undisturbed: Run, tmp_path: Path) -> None:
    runner = click.testing.CliRunner()
    for style in HERE:
        done = runner.invoke(
            command_line, ["export", str(undisturbed[0]), "--format", style, "--to", str(tmp_path / style)]
        )
        assert done.exit_code == 0, done.output
        about = json.loads((tmp_path / style / marker_name(style)).read_text())
        assert about["snapshot"] == (undisturbed[0] / "current").read_text().strip()
        told = done.stdout.split()
        files = [str(tmp_path / style / name) for name in about["files"]]
        assert set(files) <= set(told) or told == [str(tmp_path / style)], "each, or the folder of many"
        assert re.search(r"^streetloom: export: (\d+) of \1, in ", done.stderr, re.MULTILINE), "without a terminal too"
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]
    assert (
        "geoid_separation"
        in json.loads((tmp_path / "3dtiles" / "tileset.json").read_text())["asset"]["extras"]["heights"]
    )


def test_models_stand_where_the_block_does_and_look_like_its_atlas(
    found: PublishedBlock, undisturbed: Run, tmp_path: Path
) -> None:
    one = export_run(undisturbed[0], "glb", tmp_path / "all", lit=False, relief="off").path
    model = trimesh.load(one / "block.glb")
    around = {name for name, part in model.geometry.items() if part.visual.material.name == "surroundings"}
    shown = {name for name in model.graph.nodes_geometry if model.graph[name][1] not in around}
    assert shown == {*(found.names[b] for b in found.select_buildings(()).tolist()), "ground"}
    assert len(list((one / "buildings").glob("*.glb"))) == len(found.select_buildings(()))
    origin = np.array(model.metadata["origin"])
    scene, errors = found.plan.scene, []
    for part in (part for name, part in model.geometry.items() if name not in around):
        image = np.asarray(part.visual.material.baseColorTexture.convert("RGB")).astype(float)
        assert max(image.shape) <= 4096
        middle = part.vertices[part.faces].mean(axis=1)
        world = np.column_stack([middle[:, 0], -middle[:, 2], middle[:, 1]]) + origin
        normal = part.face_normals[:, [0, 2, 1]] * [1, -1, 1]
        depth, chart = scene.caster.cast(world + normal * 0.05, -normal)
        there = (chart >= 0) & (depth < 0.1)
        assert there.mean() > 0.95
        row, column = scene.locate_texels(world[there], chart[there])
        uv = part.visual.uv[part.faces].mean(axis=1)[there]
        shown = image[((1 - uv[:, 1]) * image.shape[0]).astype(int), (uv[:, 0] * image.shape[1]).astype(int)]
        for c, y, x, colour in zip(chart[there], row, column, shown, strict=True):
            errors.append(np.abs(found.textured_mesh.raster(int(c))[y, x] - colour).mean())
    assert np.median(errors) < 6
    assert np.mean(errors) < 12


def test_models_take_light_where_they_are_not_told_otherwise(
    undisturbed: Run, found: PublishedBlock, tmp_path: Path
) -> None:
    building = [found.names[int(found.select_buildings(())[0])]]
    made = {}
    for name, options in {"lit": {}, "again": {}, "night": {"night": True}, "unlit": {"lit": False}}.items():
        folder = export_run(undisturbed[0], "glb", tmp_path / name, building, **options).path  # type: ignore[arg-type]
        with (folder / "block.glb").open("rb") as file:  # type: ignore[operator]
            made[name] = (read_glb_header(file)[0], (folder / "block.glb").read_bytes())  # type: ignore[operator]
    assert made["lit"][1] == made["again"][1]
    assert all("normalTexture" in one for one in made["lit"][0]["materials"])
    assert made["unlit"][0]["extensionsUsed"] == ["KHR_materials_unlit"]
    assert "emissiveTexture" in made["night"][0]["materials"][0]
    assert "emissiveTexture" not in made["lit"][0]["materials"][0]
    assert len(made["unlit"][1]) < len(made["lit"][1])
    tiles = export_run(undisturbed[0], "3dtiles", tmp_path / "tiles", building, night=True).path
    with (tiles / "tiles" / "full.glb").open("rb") as file:  # type: ignore[operator]
        said = read_glb_header(file)[0]
    assert "KHR_materials_variants" not in said["extensionsUsed"]
    assert any("emissiveTexture" in one for one in said["materials"])
    with pytest.raises(InputError, match="--night"):
        export_run(undisturbed[0], "glb", tmp_path / "none", lit=False, night=True)
    with pytest.raises(InputError, match="--lit: is of glb and 3dtiles"):
        export_run(undisturbed[0], "lod3", tmp_path / "none", lit=True)


def test_models_name_whom_they_are_from(found: PublishedBlock, undisturbed: Run, tmp_path: Path) -> None:
    attribution = found.attribution
    assert {source.key for source in attribution.sources} >= {"buildings.path", "streets.path"}
    assert attribution.line.endswith(attribution.production_date or "?")
    made = export_run(undisturbed[0], "glb", tmp_path / "glb").path
    for file in (made / "block.glb", next((made / "buildings").glob("*.glb"))):
        with file.open("rb") as opened:
            assert read_glb_header(opened)[0]["asset"]["copyright"] == attribution.line
    for model in (found.snapshot.model, found.snapshot.overview):
        with model.open("rb") as opened:  # type: ignore[union-attr]
            said = read_glb_header(opened)[0]["asset"]["copyright"]
        assert said == replace(attribution, production_date=None).line
    assert json.loads(found.snapshot.tiles.read_text())["attribution"]["sources"] == attribution.to_json()["sources"]


def test_tiles_stand_on_the_block(found: PublishedBlock, undisturbed: Run, tmp_path: Path) -> None:
    path = export_run(undisturbed[0], "3dtiles", tmp_path / "tiles").files[0]
    tileset = json.loads(path.read_text())
    matrix = np.array(tileset["root"]["transform"]).reshape(4, 4).T
    longitude, latitude, _ = Transformer.from_crs("EPSG:4978", "EPSG:4979", always_xy=True).transform(*matrix[:3, 3])
    items = gpd.read_parquet(found.snapshot.items)
    assert items.xmin.min() - 0.001 < longitude < items.xmax.max() + 0.001
    assert items.ymin.min() - 0.001 < latitude < items.ymax.max() + 0.001
    block, objects = tileset["root"]["children"]
    assert (path.parent / block["content"]["uri"]).is_file()
    assert (path.parent / objects["content"]["uri"]).is_file()
    assert block["children"]


@pytest.mark.parametrize("textures", [None, "factored"])
def test_tiles_have_the_coordinates_of_the_block(
    textures: str | None, found: PublishedBlock, undisturbed: Run, tmp_path: Path
) -> None:
    done = export_run(undisturbed[0], "3dtiles", tmp_path / "tiles", textures=textures, crs="native")
    assert not any("geoid_separation" in note for note in done.notes)
    tileset = json.loads((tmp_path / "tiles" / "tileset.json").read_text())
    extras = tileset["asset"]["extras"]
    assert extras["crs"] == found.crs
    assert "not earth-centred" in extras["coordinates"]
    matrix = np.array(tileset["root"]["transform"]).reshape(4, 4).T
    np.testing.assert_array_equal(matrix[:3, :3], np.eye(3))
    ends: list[Any] = []
    for path in (tmp_path / "tiles" / "tiles").glob("near*.glb" if textures else "full*.glb"):
        with path.open("rb") as file:
            document = read_glb_header(file)[0]
        for node in document["nodes"]:
            for primitive in document["meshes"][node["mesh"]]["primitives"]:
                positions = document["accessors"][primitive["attributes"]["POSITION"]]
                scale, shift = node.get("scale", 1.0), node.get("translation", 0.0)
                ends += [np.array(positions[end]) * scale + shift for end in ("min", "max")]
    world = np.array(ends)[:, [0, 2, 1]] * [1, -1, 1] + matrix[:3, 3]
    mesh = found.textured_mesh.mesh
    drawn = mesh.vertices[np.unique(mesh.triangles)]
    np.testing.assert_allclose(world.min(axis=0), drawn.min(axis=0), atol=0.3 if textures else 0.02)
    np.testing.assert_allclose(world.max(axis=0), drawn.max(axis=0), atol=0.3 if textures else 0.02)


def test_another_crs_is_refused(undisturbed: Run) -> None:
    with pytest.raises(InputError, match="--crs: is of 3dtiles and factored 3dtiles; leave it out with gpkg"):
        export_run(undisturbed[0], "gpkg", crs="native")
    with pytest.raises(InputError, match="--crs EPSG:3857: is not written; use native"):
        export_run(undisturbed[0], "3dtiles", crs="EPSG:3857")


class _OtherAttributes:
    """A group of a store with other attributes."""

    def __init__(self, group: Any, attributes: dict[str, Any]) -> None:
        self.group, self.attrs = group, attributes

    def __getattr__(self, name: str) -> Any:
        return getattr(self.group, name)

    def __getitem__(self, path: str) -> Any:
        return self.group[path]

    def __contains__(self, path: str) -> bool:
        return path in self.group


def test_heights_over_the_ellipsoid_are_the_blocks_and_its_geoid_separation(
    found: PublishedBlock, tmp_path: Path
) -> None:
    heights = []
    for separation in (None, 17.5):
        folder = tmp_path / str(separation)
        folder.mkdir()
        stated = _OtherAttributes(found.group, dict(found.group.attrs) | {"geoid_separation": separation})
        _, notes = write_3dtiles(replace(found, group=cast(Any, stated)), found.select_buildings(())[:1], folder)
        assert len(notes) == (separation is None)
        tileset = json.loads((folder / "tileset.json").read_text())
        centre = np.array(tileset["root"]["transform"])[12:15]
        heights.append(Transformer.from_crs("EPSG:4978", "EPSG:4979", always_xy=True).transform(*centre)[2])
        assert ("17.5 m" in tileset["asset"]["extras"]["heights"]) == (separation is not None)
    assert heights[1] - heights[0] == pytest.approx(17.5, abs=1e-3)


@pytest.mark.parametrize("style", ["3dtiles", "cityjsonseq", "gpkg"])
def test_the_same_snapshot_gives_the_same_bytes(
    undisturbed: Run, found: PublishedBlock, tmp_path: Path, style: str
) -> None:
    name = found.names[int(found.select_buildings(())[-1])]
    one, two = (export_run(undisturbed[0], style, tmp_path / side, [name]).path for side in "ab")
    files = sorted(path.relative_to(one) for path in one.rglob("*") if path.is_file())
    assert len(files) > 1
    for file in files:
        assert (one / file).read_bytes() == (two / file).read_bytes(), file


def test_annotations_lie_in_their_pictures(found: PublishedBlock, undisturbed: Run, tmp_path: Path) -> None:
    path = export_run(undisturbed[0], "coco", tmp_path / "coco").files[0]
    coco = json.loads(path.read_text())
    images = {image["id"]: image for image in coco["images"]}
    assert {image["facade"] for image in images.values()} == {
        found.plan.facades.id[i] for i in found.select_finished_facades(found.select_buildings(()))
    }
    assert [a["id"] for a in coco["annotations"]] == list(range(1, len(coco["annotations"]) + 1))
    assert {c["name"] for c in coco["categories"]} == {"window", "balcony", "door", "shop"}
    for annotation in coco["annotations"]:
        x, y, width, height = annotation["bbox"]
        image = images[annotation["image_id"]]
        assert x >= 0
        assert y >= 0
        assert x + width <= image["width"] + 0.02
        assert y + height <= image["height"] + 0.02
        assert annotation["area"] == pytest.approx(width * height, rel=0.02)
    done = export_run(undisturbed[0], "labelme", tmp_path / "labelme")
    labelme = done.path
    index = json.loads((labelme / ".export.json").read_text())["files"]
    assert index == [file.name for file in done.files]
    assert set(index) == set(glob("*.json", root_dir=labelme)), "each .json there is a facade's"
    shapes = 0
    for name in index:
        value = json.loads((labelme / name).read_text())
        with Image.open(labelme / value["imagePath"]) as image:
            assert image.size == (value["imageWidth"], value["imageHeight"])
        shapes += len(value["shapes"])
    assert shapes == len(coco["annotations"])


def test_a_geopackage_has_every_column_in_the_frame_of_the_block(
    found: PublishedBlock, undisturbed: Run, tmp_path: Path
) -> None:
    building = found.names[int(found.plan.facades.building[0])]
    path = export_run(undisturbed[0], "gpkg", tmp_path / "one.gpkg", [building]).path
    assert path.is_file()
    assert {name for name, _ in pyogrio.list_layers(path)} == {
        "facades",
        "buildings",
        "roofs",
        "ground",
        "streets",
        "layer_styles",
    }
    roofs, built = gpd.read_file(path, layer="roofs"), gpd.read_file(path, layer="buildings").set_index("id")
    assert roofs.has_z.all()
    assert (roofs.high_z <= roofs.building.map(built.top_z) + 0.001).all()
    assert (built.top_z - built.base_z >= built.height_m - 0.001).all()
    assert set(roofs.building) == set(built.index)
    ground = gpd.read_file(path, layer="ground")
    assert (ground.slope_deg < 45).all()
    assert (ground.high_z >= ground.low_z).all()
    facades = gpd.read_file(path, layer="facades")
    assert set(facades.columns) == {"is_facade", "low_z", "high_z", *(column.name for column in COLUMNS)}
    assert facades.crs == "EPSG:32635"
    assert set(facades.building) == {building}
    assert facades.length.to_numpy() == pytest.approx(facades.width_m, abs=0.01)
    assert shapely.get_coordinates(facades.geometry, include_z=True)[::2, 2] == pytest.approx(facades.low_z, abs=0.01)
    assert (facades.high_z - facades.low_z >= facades.height_m - 0.01).all()


@pytest.mark.parametrize("layer", [name for name in LAYER_NAMES if name != "set_aside"])
def test_a_map_program_finds_every_geometry_of_a_geopackage_valid(layer: str, undisturbed: Run, tmp_path: Path) -> None:
    path = export_run(undisturbed[0], "gpkg", tmp_path / "all.gpkg").path
    shapes = pyogrio.read_dataframe(path, layer=layer).geometry
    assert len(shapes)
    assert shapes.is_valid.all()
    assert not shapes.is_empty.any()
    assert (
        (shapes.force_2d().area > 0).all() if layer in ("buildings", "roofs", "ground") else (shapes.length > 0).all()
    )


def test_one_building_alone_has_no_ground(found: PublishedBlock, undisturbed: Run, tmp_path: Path) -> None:
    name = found.names[int(found.select_buildings(())[0])]
    one = export_run(undisturbed[0], "glb", tmp_path / "one", [name])
    assert list(trimesh.load(one.files[0]).graph.nodes_geometry) == [name]
    with pytest.raises(InputError, match=f"--building {name}x: .* did you mean {name}"):
        export_run(undisturbed[0], "glb", tmp_path / "two", [name + "x"])
    with pytest.raises(InputError, match=f"--building {name}-1: that is a facade; --building {name} is its building"):
        export_run(undisturbed[0], "glb", tmp_path / "two", [name + "-1"])
    assert not (tmp_path / "two").exists()


def test_an_export_is_replaced_and_other_folders_are_not(undisturbed: Run, tmp_path: Path) -> None:
    for _ in range(2):
        export_run(undisturbed[0], "coco", tmp_path / "again")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("dear")
    with pytest.raises(InputError, match="holds other files"):
        export_run(undisturbed[0], "coco", tmp_path / "mine")
    with pytest.raises(InputError, match="is a folder"):
        export_run(undisturbed[0], "glb", tmp_path / "block.glb")
    with pytest.raises(InputError, match="--textures: is of 3dtiles"):
        export_run(undisturbed[0], "glb", textures="webp")
    with pytest.raises(InputError, match="choose glb"):
        export_run(undisturbed[0], "gltf")
    with pytest.raises(InputError, match="holds an export of coco"):
        export_run(undisturbed[0], "labelme", tmp_path / "again")
    (tmp_path / "again" / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match=r"notes\.txt was added or changed"):
        export_run(undisturbed[0], "coco", tmp_path / "again")
    (tmp_path / "layers.gpkg").write_text("not yours")
    with pytest.raises(InputError, match="is there already"):
        export_run(undisturbed[0], "gpkg", tmp_path / "layers.gpkg")
    assert (tmp_path / "layers.gpkg").read_text() == "not yours"
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["letter.txt"]


def change_geopackage(path: Path, *statements: str) -> None:
    with closing(sqlite3.connect(path)) as file, file:
        for statement in statements:
            file.execute(statement)


@pytest.mark.parametrize("as_file", [False, True])
def test_a_geopackage_is_replaced_where_its_rows_are_as_exported(
    as_file: bool, undisturbed: Run, found: PublishedBlock, tmp_path: Path
) -> None:
    target = tmp_path / ("layers.gpkg" if as_file else "layers")
    building = [found.names[int(found.select_buildings(())[0])]]
    (path,) = export_run(undisturbed[0], "gpkg", target, building).files
    one = path.read_bytes()
    pyogrio.read_info(path, layer="buildings")  # GDAL writes what it found beside the file
    with closing(sqlite3.connect(path)) as file:  # as QGIS does with a file that it shows
        file.execute("PRAGMA journal_mode = WAL")
        file.execute("PRAGMA journal_mode = DELETE")
    assert path.read_bytes() != one
    export_run(undisturbed[0], "gpkg", target, building)
    assert path.read_bytes() == one
    assert {file.name for file in path.parent.iterdir()} <= {path.name, "export.json"}
    change_geopackage(path, "CREATE TABLE notes (text TEXT)")
    with pytest.raises(InputError, match="changed since the export"):
        export_run(undisturbed[0], "gpkg", target, building)
    change_geopackage(path, "DROP TABLE notes")
    export_run(undisturbed[0], "gpkg", target, building)
    change_geopackage(path, "UPDATE gpkg_contents SET description = 'mine' WHERE table_name = 'buildings'")
    with pytest.raises(InputError, match="changed since the export"):
        export_run(undisturbed[0], "gpkg", target, building)


def test_a_geopackage_of_somebody_else_is_not_replaced(undisturbed: Run, tmp_path: Path) -> None:
    path = tmp_path / "mine.gpkg"
    gpd.GeoDataFrame({"id": ["a"]}, geometry=gpd.points_from_xy([0], [0]), crs=3067).to_file(path, layer="x")
    with pytest.raises(InputError, match="no GeoPackage that this program exported"):
        export_run(undisturbed[0], "gpkg", path)
    os.mkfifo(tmp_path / "pipe.gpkg")
    with pytest.raises(InputError, match="no GeoPackage that this program exported"):
        export_run(undisturbed[0], "gpkg", tmp_path / "pipe.gpkg")


def test_columns_have_the_same_types_whatever_their_values(undisturbed: Run, tmp_path: Path) -> None:
    """Else blocks of a city could not be joined: a column of integers without one value would be of doubles."""
    folder = export_run(undisturbed[0], "geoparquet", tmp_path / "tables").path
    facades = pq.read_schema(folder / "facades.parquet")
    for column in COLUMNS:
        if column.type.startswith("int"):
            assert facades.field(column.name).type == column.type, column.name
    assert pq.read_schema(folder / "buildings.parquet").field("levels").type == "int32"
    (package,) = export_run(undisturbed[0], "gpkg", tmp_path / "package").files
    info = pyogrio.read_info(package, layer="facades")
    types = dict(zip(info["fields"], info["dtypes"], strict=True))
    assert {types[column.name] for column in COLUMNS if column.type == "int32"} == {"int32"}


def test_what_is_not_published_is_refused_in_one_line(undisturbed: Run, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nothing is published there"):
        export_run(tmp_path, "glb")
    broken = tmp_path / "broken"
    snapshot = (undisturbed[0] / "current").read_text().strip()
    shutil.copytree(undisturbed[0] / "store", broken / "store")
    (broken / "published" / snapshot).mkdir(parents=True)
    shutil.copy(undisturbed[0] / "published" / snapshot / "items.parquet", broken / "published" / snapshot)
    (broken / "current").write_text(snapshot)
    done = click.testing.CliRunner().invoke(command_line, ["export", str(broken), "--format", "glb"])
    assert done.exit_code == 2
    assert "0000.jpg is missing" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    (broken / "published" / snapshot / "pages").mkdir()
    for path in (undisturbed[0] / "published" / snapshot / "pages").iterdir():
        (broken / "published" / snapshot / "pages" / path.name).write_bytes(path.read_bytes()[:500])
    with pytest.raises(
        InputError, match=r"\.jpg cannot be read as a picture; `streetloom run BLOCK\.yaml --out .*` publishes"
    ):
        export_run(broken, "glb", tmp_path / "glb")
    assert not (tmp_path / "glb").exists()
    for other in ("0" * 20, "short"):
        (broken / "published" / other).mkdir()
        (broken / "published" / other / "items.parquet").touch()
        (broken / "current").write_text(other)
        with pytest.raises(StoreError, match=f"does not hold snapshot {other}"):
            export_run(broken, "glb")
