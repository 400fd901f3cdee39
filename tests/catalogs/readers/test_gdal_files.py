"""GDAL is opened through one guard: regular files of known formats, without views, programs and addresses."""

from __future__ import annotations

import ast
import os
import sqlite3
from pathlib import Path

import geopandas
import numpy as np
import pytest
import rasterio
import shapely

import catalogs
from catalogs.city.tile_index import tile_files_in_area
from catalogs.readers import gdal_files
from catalogs.readers.annotations import read_correction_annotations
from catalogs.readers.vectors.layers import read_layer_features
from facade_core.core.errors import InputError

SOURCES = Path(catalogs.__file__).parents[1]
# Functions that open files with GDAL, and modules that write with them.
OPENERS = {
    "rasterio": {"open"},
    "pyogrio": {"list_layers", "read_info", "read_dataframe", "read_arrow", "open_arrow", "read_bounds", "read", "raw"},
    "geopandas": {"read_file", "list_layers"},
    "gpd": {"read_file", "list_layers"},
    "fiona": {"open"},
    "gdal": {"Open", "OpenEx"},
}
GUARD = "catalogs/readers/gdal_files.py"
WRITERS = {"tasks/export/orthophotos.py"}  # rasterio.open for writing
HEIGHTS = geopandas.GeoDataFrame({"id": ["a"], "height_m": [9.0]}, geometry=[shapely.box(0, 0, 9, 9)], crs="EPSG:3067")
ENDLESS = "WITH RECURSIVE r(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM r) SELECT"


def test_no_module_opens_files_with_gdal_but_the_guard() -> None:
    found = set()
    for package in ("catalogs", "facade_core", "tasks", "flows"):
        for file in (SOURCES / package).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
                if (
                    isinstance(node, ast.Attribute)
                    and isinstance(node.value, ast.Name)
                    and node.attr in OPENERS.get(node.value.id, ())
                ):
                    found.add(file.relative_to(SOURCES).as_posix())
                if isinstance(node, ast.ImportFrom) and node.module in OPENERS:
                    assert not {name.name for name in node.names} & OPENERS[node.module], file
    assert found == {GUARD, *WRITERS}


def geopackage(path: Path, *statements: str) -> Path:
    HEIGHTS.to_file(path, layer="x", driver="GPKG")
    with sqlite3.connect(path) as file:
        for statement in statements:
            file.execute(statement)
    return path


BUILDINGS = "INSERT INTO gpkg_contents (table_name, data_type, identifier) VALUES ('buildings', 'attributes', 'b')"
REFUSED = {
    "registered-view": [f"CREATE VIEW buildings AS {ENDLESS} count(*) AS height_m, 'a' AS id FROM r", BUILDINGS],
    "generated": ["CREATE TABLE buildings (id TEXT, height_m AS (length(zeroblob(1000000000))))", BUILDINGS],
    "generated-stored": ["CREATE TABLE t (id TEXT, h AS (length(id)) STORED)"],
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_geopackage_that_is_a_program_is_refused_everywhere(case: str, tmp_path: Path) -> None:
    path = geopackage(tmp_path / "b.gpkg", *REFUSED[case])
    with pytest.raises(InputError, match=r"b\.gpkg: .* program; write its layers as tables"):
        read_layer_features(path, "outlines", ())
    with pytest.raises(InputError, match=r"b\.gpkg: .* program; write its layers as tables"):
        read_correction_annotations(path, {})
    with pytest.raises(InputError, match=r"b\.gpkg: .* program; write its layers as tables"):
        tile_files_in_area(path, None)


def test_a_view_that_is_no_layer_is_not_evaluated(tmp_path: Path) -> None:
    path = geopackage(tmp_path / "b.gpkg", f"CREATE VIEW buildings AS {ENDLESS} count(*) AS height_m, 'a' AS id FROM r")
    assert gdal_files.list_layers(path) == [("x", "Polygon")]
    assert read_layer_features(path, "outlines", ()).ids == ["a"]
    with pytest.raises(InputError, match="has no table buildings"):
        read_correction_annotations(path, {})


@pytest.mark.parametrize(
    "text",
    [
        "<OGRVRTDataSource><OGRVRTLayer name='buildings'><SrcDataSource>/etc/passwd</SrcDataSource></OGRVRTLayer>"
        "</OGRVRTDataSource>",
        "PG:host=127.0.0.1",
        "",
    ],
)
@pytest.mark.parametrize("suffix", [".gpkg", ".shp", ".fgb", ".geojson"])
def test_a_text_of_another_driver_is_refused(text: str, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"b{suffix}"
    path.write_text(text)
    with pytest.raises(InputError, match="by its content; export it again"):
        gdal_files.list_layers(path)
    with pytest.raises(InputError):
        read_correction_annotations(path, {})


@pytest.mark.parametrize("name", ["b.gpkg-wal", "b.gpkg-journal", "b.gpkg.aux.xml", "B.GPKG-WAL"])
def test_a_pipe_beside_a_geopackage_is_refused(name: str, tmp_path: Path) -> None:
    path = geopackage(tmp_path / "b.gpkg")
    os.mkfifo(tmp_path / name)
    with pytest.raises(InputError, match=rf"{name} beside it is a pipe"):
        read_layer_features(path, "outlines", ())


@pytest.mark.parametrize("name", ["b.prj", "b.qix", "b.cpg", "b.sbn", "b.shp.xml"])
def test_a_pipe_beside_a_shapefile_is_refused(name: str, tmp_path: Path) -> None:
    HEIGHTS.to_file(tmp_path / "b.shp")
    (tmp_path / name).unlink(missing_ok=True)
    os.mkfifo(tmp_path / name)
    with pytest.raises(InputError, match=rf"{name} beside it is a pipe"):
        read_layer_features(tmp_path / "b.shp", "outlines", ())


@pytest.mark.parametrize("name", ["d.tif.ovr", "d.tif.msk", "d.tif.aux.xml", "d.tfw", "d.prj", "d.IMD", "d_RPC.TXT"])
def test_a_pipe_or_device_beside_a_raster_is_refused(name: str, tmp_path: Path) -> None:
    with rasterio.open(
        tmp_path / "d.tif", "w", driver="GTiff", width=9, height=9, count=1, dtype="float32", crs="EPSG:3067",
        transform=rasterio.transform.from_origin(0, 9, 1, 1),
    ) as file:  # fmt: skip
        file.write(np.ones((1, 9, 9), np.float32))
    (tmp_path / "dam").symlink_to("/dev/null")  # of another file
    with gdal_files.open_raster_dataset(tmp_path / "d.tif", "GTiff", {}) as raster:
        assert raster.read(1).sum() == 81
    (tmp_path / name).symlink_to("/dev/zero")
    with (
        pytest.raises(InputError, match=rf"{name} beside it is a pipe"),
        gdal_files.open_raster_dataset(tmp_path / "d.tif", "GTiff", {}),
    ):
        pass


@pytest.mark.parametrize(
    ("case", "words"),
    [
        ("import_gpkg_any_driver/f.gpkg", r"is no \.gpkg file by its content"),
        ("import_gpkg_any_driver/passwd.gpkg", r"is no \.gpkg file by its content"),
        ("import_gpkg_any_driver/view.gpkg", r"has no table buildings|is a view or made up by a program"),
        ("buildings-gpkg-generated-bomb/b.gpkg", r"is generated by a program"),
    ],
)
def test_cases_of_the_second_trial(case: str, words: str, data: Path) -> None:
    if not (data / "bad_inputs_2" / case).is_file():
        pytest.skip("no bad inputs in the data folder")
    with pytest.raises(InputError, match=words):
        read_correction_annotations(data / "bad_inputs_2" / case, {})
