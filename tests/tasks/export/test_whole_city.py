"""Exports of a whole city: of blocks that are copies of one run, opened by other programs."""

from __future__ import annotations

import json
import shutil
import sqlite3
import subprocess
import sys
import weakref
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import unquote
from xml.etree import ElementTree as ET

import click.testing
import geopandas as gpd
import numpy as np
import pyarrow.parquet as pq
import pyogrio
import pystac
import pytest
import rasterio

from catalogs.published.map_layers import LAYER_NAMES
from facade_core.core.errors import InputError
from flows.cli.commands import command_line
from tasks.engine.progress import StageProgress, add_listener
from tasks.export.formats import export_run
from tasks.export.registry import FORMATS, CityFormat, list_city_formats
from tasks.export.targets import find_changed_file, read_marker
from tasks.export.whole_city import city_export
from tasks.publish.published_run import PublishedBlock, open_published_snapshot
from tests.exports import select_formats, skip_unless_installed
from tests.tasks.export.cities import write_city
from tests.tasks.export.test_city_models import cityjson_is_sound

Run = tuple[Path, dict[str, Any]]
NAMES = ("a9", "a10")
# Formats by how they are written; lod3 is as cityjsonseq, and slow.
EACH = select_formats(one for one in list_city_formats() if one != "lod3")


@pytest.fixture(scope="module")
def city(undisturbed: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_city(tmp_path_factory.mktemp("city"), undisturbed[0], NAMES)


@pytest.fixture(scope="module")
def export_once(city: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """The folder of an export of the city, made once and moved away from it; changed by none."""
    folder, made = tmp_path_factory.mktemp("export_once"), {}

    def one(style: str) -> Path:
        if style not in made:
            export_run(city, style, folder / "here" / style)
            made[style] = shutil.move(folder / "here" / style, folder / style)
        return made[style]

    return one


def read_files(folder: Path) -> dict[str, bytes]:
    """What was export_once, without what GDAL wrote beside it when it read it."""
    files = (path for path in folder.rglob("*") if path.is_file() and not path.name.endswith(".aux.xml"))
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def test_each_format_holds_a_city_or_says_what_does(city: Path, tmp_path: Path) -> None:
    for style in FORMATS.keys() - set(list_city_formats()):
        others = " or ".join(FORMATS[style].city)
        assert set(FORMATS[style].city) <= set(list_city_formats())
        done = click.testing.CliRunner().invoke(command_line, ["export", str(city), "--format", style])
        assert done.exit_code == 2
        assert f"use {others}" in done.stderr
        assert len(done.stderr.splitlines()) == 1
    assert not (city / "exports").exists()


def test_tables_have_every_block_once(export_once: Any, found: PublishedBlock) -> None:
    items = gpd.read_parquet(found.snapshot.items)
    (package,) = export_once("gpkg").glob("*.gpkg")
    tables = export_once("geoparquet")
    assert package.name == "twins.gpkg"
    for layer in LAYER_NAMES:
        if layer == "set_aside":
            continue
        of_package = pyogrio.read_dataframe(package, layer=layer)
        of_parquet = gpd.read_parquet(tables / f"{layer}.parquet")
        assert len(of_package) == len(of_parquet) == pyogrio.read_info(package, layer)["features"] > 0
        assert of_package.crs == of_parquet.crs == found.crs
        assert of_package.geometry.to_wkb().tolist() == of_parquet.geometry.to_wkb().tolist()
        assert set(of_package.columns) == set(of_parquet.columns)
        assert Counter(of_package.run) == dict.fromkeys(("blocks/a9", "blocks/a10"), len(of_package) // 2)
        for key in {"id", "building"} & set(of_package.columns):
            assert of_package[key].tolist() == of_parquet[key].tolist()
        if "id" in of_package.columns:
            assert not of_package.duplicated(["run", "id"]).any()
    facades = gpd.read_parquet(tables / "facades.parquet")
    assert set(facades.id) == set(items[items.kind == "facade"].id)
    assert pq.ParquetFile(tables / "facades.parquet").num_row_groups == 2
    assert facades.total_bounds.tolist() == pytest.approx(
        json.loads(pq.read_schema(tables / "facades.parquet").metadata[b"geo"])["columns"]["geometry"]["bbox"]
    )
    assert pyogrio.read_info(package, layer="facades")["layer_metadata"]["attribution"] == found.attribution.line
    assert pq.read_schema(tables / "facades.parquet").metadata[b"attribution"].decode() == found.attribution.line


@pytest.mark.parametrize("whole", [False, True])
def test_a_geopackage_has_a_qgis_style_for_each_layer(
    whole: bool, export_once: Any, undisturbed: Run, tmp_path: Path
) -> None:
    folder = export_once("gpkg") if whole else export_run(undisturbed[0], "gpkg", tmp_path / "gpkg").path
    (package,) = folder.glob("*.gpkg")
    with closing(sqlite3.connect(package)) as file:
        styles = file.execute(
            "SELECT f_table_name, f_geometry_column, styleQML, useAsDefault FROM layer_styles"
        ).fetchall()
        geometries = dict(file.execute("SELECT table_name, column_name FROM gpkg_geometry_columns"))
        assert {(name, column) for name, column, _, _ in styles} == set(geometries.items())
        for layer, _, qml, is_default in styles:
            assert is_default == 1
            rules = list(ET.fromstring(qml.split("\n", 1)[1]).iter("rule"))
            assert rules
            for rule in rules:  # QGIS's comparisons are SQL's
                if rule.get("filter") not in (None, "ELSE"):
                    file.execute(f'SELECT count(*) FROM "{layer}" WHERE {rule.get("filter")}').fetchone()
    assert "layer_styles" in {name for name, _ in pyogrio.list_layers(package)}


@pytest.mark.parametrize("style", ["cityjsonseq", "lod3"])
def test_a_stream_of_a_city_has_one_transform_and_ids_of_their_own(
    style: str, city: Path, found: PublishedBlock, tmp_path: Path
) -> None:
    chosen = found.names[int(found.plan.facades.building[found.select_finished_facades(found.select_buildings(()))[0]])]
    (path,) = export_run(city, style, tmp_path / style, [chosen] if style == "lod3" else []).files
    assert path.name == ("twins.lod3.city.jsonl" if style == "lod3" else "twins.city.jsonl")
    header, *features = map(json.loads, path.read_text().splitlines())
    assert header["CityObjects"] == {}
    assert header["+metadata-extended"]["constraints"]["userNote"] == found.attribution.line
    ids = [id for feature in features for id in feature["CityObjects"]]
    assert len(ids) == len(set(ids))
    kinds = Counter(thing["type"] for feature in features for thing in feature["CityObjects"].values())
    assert kinds["Building"] == 2 * (1 if style == "lod3" else len(found.select_buildings(())))
    assert (kinds["TINRelief"] >= 2) == (style != "lod3")
    surfaces = {
        surface["type"]
        for feature in features
        for thing in feature["CityObjects"].values()
        for geometry in thing["geometry"]
        for surface in geometry.get("semantics", {}).get("surfaces", ())
    }
    assert ("Window" in surfaces) == (style == "lod3")
    pictures = set()
    for feature in features:
        assert "transform" not in feature
        assert feature["id"] in feature["CityObjects"]
        cityjson_is_sound(feature)
        pictures |= {texture["image"] for texture in feature["appearance"]["textures"]}
        for thing in feature["CityObjects"].values():
            assert set(thing.get("parents", ())) | set(thing.get("children", ())) <= feature["CityObjects"].keys()
    assert all((path.parent / picture).is_file() for picture in pictures)
    assert {picture.split("/")[1] for picture in pictures} == set(NAMES)


def test_cjio_reads_a_stream_of_a_city(export_once: Any, found: PublishedBlock, tmp_path: Path) -> None:
    path = export_once("cityjsonseq") / "twins.city.jsonl"
    collected = tmp_path / "collected.city.json"
    program = "from cjio.cjio import cli; cli()"
    command = [sys.executable, "-c", program, "--suppress_msg", "stdin", "save", str(collected)]
    with path.open() as lines:
        subprocess.run(command, stdin=lines, check=True, capture_output=True, timeout=300)
    model = json.loads(collected.read_text())
    buildings = [id for id, thing in model["CityObjects"].items() if thing["type"] == "Building"]
    assert len(buildings) == 2 * len(found.select_buildings(()))


def test_buildings_of_a_cut_city_keep_their_ids(undisturbed: Run, found: PublishedBlock, tmp_path: Path) -> None:
    building = found.names[int(found.select_buildings(())[0])]
    whole = write_city(tmp_path / "city", undisturbed[0], ["x1"], is_cut=True)
    path = export_run(whole, "cityjsonseq", tmp_path / "seq", [building]).files[0]
    features = list(map(json.loads, path.read_text().splitlines()))[1:]
    assert [feature["id"] for feature in features] == [building]
    assert all(id == building or id.startswith("x1:") for id in features[0]["CityObjects"])


def test_a_tileset_of_a_city_is_whole_by_itself(export_once: Any, found: PublishedBlock) -> None:
    folder = export_once("3dtiles").resolve()
    root = json.loads((folder / "tileset.json").read_text())
    assert root["asset"]["extras"]["attribution"]["line"] == found.attribution.line
    assert len(root["root"]["children"]) == 2
    waiting, models = [folder / "tileset.json"], set()
    while waiting:
        path = waiting.pop()
        tiles = [json.loads(path.read_text())["root"]]
        while tiles:
            tile = tiles.pop()
            tiles += tile.get("children", [])
            for child in tile.get("children", []):
                assert child["geometricError"] <= tile["geometricError"]
            if uri := tile.get("content", {}).get("uri"):
                target = (path.parent / unquote(uri)).resolve()
                assert target.is_relative_to(folder)
                assert target.is_file()
                (waiting.append if target.suffix == ".json" else models.add)(target)
    # neighbours of a block, which the city has itself, are tilesets that no other refers to
    assert models == {path.resolve() for path in folder.rglob("*.glb") if path.name != "surroundings.glb"}
    centre, radius = np.array(root["root"]["boundingVolume"]["sphere"][:3]), root["root"]["boundingVolume"]["sphere"][3]
    for child in root["root"]["children"]:
        x, y, z, reach = child["boundingVolume"]["sphere"]
        assert np.linalg.norm(np.array([x, y, z]) - centre) + reach <= radius + 1e-6


def test_tiles_of_a_city_have_the_coordinates_of_its_blocks(
    undisturbed: Run, found: PublishedBlock, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = write_city(tmp_path / "city", undisturbed[0], NAMES)
    building = int(found.select_buildings(())[0])
    folder = export_run(whole, "3dtiles", buildings=[found.names[building]], crs="native").path
    assert folder == whole / "exports" / "3dtiles-native", "the city's own tileset refers to the folder 3dtiles"
    root = json.loads((folder / "tileset.json").read_text())  # type: ignore[operator]
    assert root["asset"]["extras"]["crs"] == found.crs
    assert "not earth-centred" in root["asset"]["extras"]["coordinates"]
    source = found.textured_mesh
    corners = source.mesh.vertices[source.mesh.triangles[source.charts.building[source.mesh.chart] == building]]
    sphere = np.array(root["root"]["boundingVolume"]["sphere"])
    assert np.linalg.norm(corners.reshape(-1, 3) - sphere[:3], axis=1).max() <= sphere[3] + 0.1
    assert sphere[3] < 200, "metres around the building"
    monkeypatch.setattr(city_export, "open_root", lambda session: SimpleNamespace(attrs={"crs": "EPSG:3067"}))
    with pytest.raises(InputError, match=r"block a9 is in EPSG:32635 and a10 in EPSG:3067.*; leave --crs out"):
        export_run(whole, "3dtiles", tmp_path / "other", crs="native")


def test_orthophotos_of_a_city_are_one_raster_and_one_catalogue(export_once: Any, found: PublishedBlock) -> None:
    folder = export_once("cog")
    catalogue = pystac.Catalog.from_file(folder / "catalog.json")
    items = list(catalogue.get_items(recursive=True))
    assert len(items) == 2 * len(found.plan.facades.id)
    assert {child.id for child in catalogue.get_children()} == {f"{found.block}-orthophotos"}
    with rasterio.open(folder / "blocks" / "a9" / "facades.vrt") as row, rasterio.open(folder / "facades.vrt") as sheet:
        assert sheet.count == 3
        assert sheet.height > 2 * row.height
        assert sheet.crs is not None
        names = sorted(path.stem for path in (folder / "blocks" / "a9").glob("*.tif"))
        assert len(row.files) == 1 + len(names)
        shown = row.read(1, out_shape=(row.height // 4, row.width // 4))
        of_city = sheet.read(1, window=((0, row.height), (0, row.width)), out_shape=shown.shape)
        assert (shown == of_city).mean() > 0.99
        mask = row.dataset_mask()
        assert 0.2 < (mask > 0).mean() < 0.95
        first = next(one for one in found.plan.facades.id)
        with rasterio.open(folder / "blocks" / "a9" / f"{first}.tif") as picture:
            if picture.res[0] == row.res[0]:
                top = round((row.bounds.top - picture.bounds.top) / row.res[1])
                part = row.read(2)[top : top + picture.height, : picture.width]
                assert (part == picture.read(2)).mean() > 0.98


@skip_unless_installed("usd")
def test_a_stage_of_a_city_loads_blocks_where_they_are(export_once: Any, found: PublishedBlock) -> None:
    from pxr import Usd, UsdGeom

    folder = export_once("usd")
    bare = Usd.Stage.Open(str(folder / "twins.usda"), Usd.Stage.LoadNone)
    assert [prim.GetDisplayName() for prim in bare.GetDefaultPrim().GetAllChildren()] == ["a9", "a10"]
    assert not [prim for prim in bare.Traverse() if prim.IsA(UsdGeom.Mesh)]
    stage = Usd.Stage.Open(str(folder / "twins.usda"))
    origin = np.array(json.loads(stage.GetRootLayer().customLayerData["streetloom"]["origin"]))
    box = UsdGeom.BBoxCache(Usd.TimeCode.Default(), ["default"]).ComputeWorldBound(stage.GetDefaultPrim())
    mesh = found.textured_mesh.mesh
    corners = mesh.vertices[mesh.triangles.ravel()]
    reach = box.ComputeAlignedRange()
    np.testing.assert_allclose(np.array(reach.GetMin()) + origin, corners.min(axis=0), atol=0.01)
    np.testing.assert_allclose(np.array(reach.GetMax()) + origin, corners.max(axis=0), atol=0.01)
    assert not list(folder.rglob("*.usdz"))


@pytest.mark.long
@pytest.mark.parametrize("style", EACH)
def test_a_killed_export_goes_on_and_gives_the_same_bytes(
    style: str, city: Path, export_once: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = read_files(export_once(style))
    entry, written = FORMATS[style], []
    kind = entry.city
    assert isinstance(kind, CityFormat)
    write = kind.write_part or entry.write

    def dying(results: PublishedBlock, *arguments: Any, **options: Any) -> Any:
        done = write(results, *arguments, **options)
        written.extend(set(NAMES) & set(Path(str(results.snapshot.items)).parts))
        if len(written) == 2:
            raise KeyboardInterrupt
        return done

    changed: dict[str, Any] = {"city": replace(kind, write_part=dying)} if kind.write_part else {"write": dying}
    monkeypatch.setitem(FORMATS, style, replace(entry, **changed))
    with pytest.raises(KeyboardInterrupt):
        export_run(city, style, tmp_path / style)
    assert not (tmp_path / style).exists()
    export_run(city, style, tmp_path / style)
    assert written == ["a9", "a10", "a10"], "what was finished is not written again"
    assert read_files(tmp_path / style) == expected
    assert [path.name for path in tmp_path.iterdir()] == [style]


def test_a_kill_while_parts_are_joined_is_resumed(
    city: Path, export_once: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    entry = FORMATS["gpkg"]
    kind = entry.city
    assert isinstance(kind, CityFormat)

    def dying(folder: Path, *rest: Any) -> list[str]:
        kind.join(folder, *rest)
        raise KeyboardInterrupt

    monkeypatch.setitem(FORMATS, "gpkg", replace(entry, city=replace(kind, join=dying)))
    with pytest.raises(KeyboardInterrupt):
        export_run(city, "gpkg", tmp_path / "gpkg")
    monkeypatch.setitem(FORMATS, "gpkg", entry)
    events: list[StageProgress] = []
    stop = add_listener(events.append)
    export_run(city, "gpkg", tmp_path / "gpkg")
    stop()
    assert [(e.finished, e.total, e.earlier) for e in events if e.stage == "blocks"] == [
        (0, 2, 0),
        (1, 2, 1),
        (2, 2, 2),
    ]
    assert read_files(tmp_path / "gpkg") == read_files(export_once("gpkg"))


def test_an_unchanged_export_is_kept_and_a_new_block_alone_is_written(undisturbed: Run, tmp_path: Path) -> None:
    whole = write_city(tmp_path / "city", undisturbed[0], NAMES)
    folder = export_run(whole, "cog").path
    assert folder == whole / "exports" / "cog"
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    assert export_run(whole, "cog").files == (folder / "facades.vrt", folder / "catalog.json")
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before
    write_city(whole, undisturbed[0], [*NAMES, "b1"])
    events: list[StageProgress] = []
    stop = add_listener(events.append)
    export_run(whole, "cog")
    stop()
    assert [(e.finished, e.earlier) for e in events if e.stage == "blocks"][-1] == (3, 2)
    write_city(whole, undisturbed[0], ["b1"])
    export_run(whole, "cog")
    assert [path.name for path in (folder / "blocks").iterdir()] == ["b1"]


def test_the_export_of_a_block_alone_is_taken_over(undisturbed: Run, tmp_path: Path, export_once: Any) -> None:
    whole = write_city(tmp_path / "city", undisturbed[0], NAMES)
    for name in NAMES:
        export_run(whole / "blocks" / name, "cog")
    (whole / "blocks" / "a10" / "exports" / "cog" / "mine.txt").write_text("changed")
    events: list[StageProgress] = []
    stop = add_listener(events.append)
    folder = export_run(whole, "cog", tmp_path / "cog").path
    stop()
    assert [(e.finished, e.earlier) for e in events if e.stage == "blocks"][-1] == (2, 1), "of one that nobody changed"
    assert read_files(folder) == read_files(export_once("cog"))


def test_what_somebody_changed_is_not_replaced(city: Path, export_once: Any, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(export_once("cog"), tmp_path / "cog"))
    about = read_marker(folder)
    assert about is not None
    assert find_changed_file(folder, about) is None
    touched = next((folder / "blocks" / "a10").glob("*.tif"))
    touched.write_bytes(touched.read_bytes()[:-1])
    with pytest.raises(InputError, match=rf"blocks/a10/{touched.name} was added or changed"):
        export_run(city, "cog", folder)
    (folder / "blocks" / "a9" / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match=r"blocks/a10/.*|blocks/a9/notes\.txt was added"):
        export_run(city, "cog", folder)


def test_blocks_that_are_not_done_are_named(undisturbed: Run, tmp_path: Path) -> None:
    whole = write_city(tmp_path / "city", undisturbed[0], ["done", "failed", "none"])
    (whole / "blocks" / "failed" / "ended.json").write_text(json.dumps({"code": 70}))
    (whole / "blocks" / "none" / "current").unlink()
    notes = export_run(whole, "gpkg", tmp_path / "some.gpkg").notes
    assert len(notes) == 2
    assert notes[0].startswith("block none: left out")
    assert notes[1].startswith("block failed: exported as published before")
    for name in ("done", "failed"):
        (whole / "blocks" / name / "current").unlink()
    with pytest.raises(InputError, match="none of its 3 blocks has published"):
        export_run(whole, "gpkg", tmp_path / "none.gpkg")
    (whole / "city.json").write_text("{}")
    with pytest.raises(InputError, match="list of blocks cannot be read"):
        export_run(whole, "gpkg", tmp_path / "none.gpkg")


def test_only_blocks_with_the_chosen_buildings_are_exported(city: Path, found: PublishedBlock, tmp_path: Path) -> None:
    name = found.names[int(found.select_buildings(())[0])]
    path = export_run(city, "gpkg", tmp_path / "one.gpkg", [name]).path
    assert pyogrio.read_dataframe(path, layer="buildings").id.tolist() == [name, name]
    with pytest.raises(InputError, match="--building nowhere: no published block"):
        export_run(city, "gpkg", tmp_path / "two.gpkg", [name, "nowhere"])


def test_blocks_in_several_frames_are_refused_where_a_file_has_one(
    city: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(city_export, "open_root", lambda session: SimpleNamespace(attrs={"crs": "EPSG:3067"}))
    with pytest.raises(InputError, match="block a9 is in EPSG:32635 and a10 in EPSG:3067"):
        export_run(city, "gpkg", tmp_path / "gpkg")
    assert not list(tmp_path.iterdir())


def test_a_city_in_a_bucket_is_exported_here() -> None:
    from catalogs.published.s3 import S3Path

    with pytest.raises(InputError, match="name a folder here with --to"):
        city_export.export_city(S3Path("bucket/city"), "gpkg", None, (), False, {})


def test_one_block_at_a_time_is_open(undisturbed: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = write_city(tmp_path / "city", undisturbed[0], [f"b{i}" for i in range(4)])
    opened: list[weakref.ref[PublishedBlock]] = []

    def opening(snapshot: Any) -> PublishedBlock:
        assert not [one for one in opened if one() is not None]
        opened.append(weakref.ref(found := open_published_snapshot(snapshot)))
        return found

    monkeypatch.setattr(city_export, "open_published_snapshot", opening)
    export_run(whole, "geoparquet", tmp_path / "tables")
    assert len(opened) == 5


MEMORY = """
import sys
from pathlib import Path
from tasks.export.formats import export_run
export_run(Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3]))
with open("/proc/self/status") as file:
    print(next(int(line.split()[1]) for line in file if line.startswith("VmHWM")))
"""


@pytest.mark.long
def test_memory_does_not_grow_with_the_blocks(undisturbed: Run, tmp_path: Path) -> None:
    peaks = []
    for number in (2, 8):
        whole = write_city(tmp_path / f"city{number}", undisturbed[0], [f"b{i}" for i in range(number)])
        command = [sys.executable, "-c", MEMORY, str(whole), "gpkg", str(tmp_path / f"gpkg{number}")]
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=600)
        peaks.append(int(done.stdout))
    assert peaks[1] < 1.2 * peaks[0], peaks
