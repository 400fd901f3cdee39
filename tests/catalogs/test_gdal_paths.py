"""Paths with characters that libraries take for separators of archives, addresses or parameters."""

from __future__ import annotations

import shutil
from pathlib import Path

import geopandas
import numpy as np
import pyogrio
import pytest
import rasterio
import shapely
from pyproj import CRS

from catalogs.city.tile_index import tile_files_in_area
from catalogs.gdal_paths import gdal_write_path
from catalogs.readers.annotations import read_correction_annotations
from catalogs.readers.formats import read_buildings, read_centrelines
from catalogs.readers.pictures.elevation import read_elevation

FOLDERS = ["!Projekte", "a!b", "x.zip!y", "a;b", "a?b", "a#b", "100%25", "a,b", "zip:x", "&a=1 '\""]
SUFFIXES = [".gpkg", ".geojson", ".shp", ".fgb", ".parquet"]


@pytest.fixture(scope="module")
def plain_files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("plain")
    for suffix in SUFFIXES:
        table = geopandas.GeoDataFrame(
            {"id": ["Kämp"], "height": [9.0]}, geometry=[shapely.box(24.9, 60.1, 24.91, 60.11)], crs=4326
        )
        path = folder / f"houses{suffix}"
        table.to_parquet(path) if suffix == ".parquet" else table.to_file(path)
    return folder


@pytest.mark.parametrize("name", FOLDERS)
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_reads_the_named_file(plain_files: Path, tmp_path: Path, name: str, suffix: str) -> None:
    folder = tmp_path / name
    folder.mkdir()
    for file in plain_files.glob("houses.*"):
        shutil.copy(file, folder / f"{name}{file.suffix}")
    found = read_buildings(folder / f"{name}{suffix}")
    assert [(one.id, getattr(one, "height", None)) for one in found.items] == [("Kämp", 9.0)]
    assert found.crs == "EPSG:4326"


def test_reads_no_file_of_a_part_of_the_path(
    plain_files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "!P").mkdir()
    (tmp_path / "P").mkdir()
    shutil.copy(plain_files / "houses.gpkg", tmp_path / "!P" / "houses.gpkg")
    other = geopandas.GeoDataFrame({"id": ["other"]}, geometry=[shapely.box(24.9, 60.1, 24.91, 60.11)], crs=4326)
    other.to_file(tmp_path / "P" / "houses.gpkg")
    monkeypatch.chdir(tmp_path)
    assert [one.id for one in read_buildings(Path("!P/houses.gpkg")).items] == ["Kämp"]


def test_streets_annotations_tiles_and_rasters_are_read_below_a_bang(plain_files: Path, tmp_path: Path) -> None:
    folder = tmp_path / "!P"
    folder.mkdir()
    line = geopandas.GeoDataFrame(
        {"name": ["Way"]}, geometry=[shapely.LineString([(24.9, 60.1), (24.91, 60.1)])], crs=4326
    )
    line.to_file(tmp_path / "ways.gpkg")
    shutil.move(tmp_path / "ways.gpkg", folder / "ways.gpkg")
    assert [one.name for one in read_centrelines(folder / "ways.gpkg").items] == ["Way"]

    edited = geopandas.GeoDataFrame({"id": ["w1"], "height_m": [7.0]}, geometry=[shapely.Point(0, 0)], crs=4326)
    edited.to_file(tmp_path / "edited.gpkg", layer="buildings")
    shutil.move(tmp_path / "edited.gpkg", folder / "edited.gpkg")
    assert [tuple(one) for one in read_correction_annotations(folder / "edited.gpkg", {})] == [("w1", "height", 7.0)]

    shutil.copy(plain_files / "houses.gpkg", folder / "houses.gpkg")
    tiles = geopandas.GeoDataFrame(
        {"location": ["houses.gpkg"]}, geometry=[shapely.box(24.9, 60.1, 24.91, 60.11)], crs=4326
    )
    tiles.to_file(tmp_path / "tiles.gpkg")
    shutil.move(tmp_path / "tiles.gpkg", folder / "tiles.gpkg")
    assert tile_files_in_area(folder / "tiles.gpkg", None) == [folder / "houses.gpkg"]

    profile = {"width": 20, "height": 20, "count": 1, "dtype": "float32", "crs": "EPSG:32635"}
    place = rasterio.Affine(1, 0, 385_000, 0, -1, 6_671_020)
    with rasterio.open(folder / "a!dem;.tif", "w", "GTiff", transform=place, **profile) as raster:
        raster.write(np.full((20, 20), 5.0, np.float32), 1)
    found = read_elevation(folder / "a!dem;.tif", CRS(32635), (385_005, 6_671_005, 385_010, 6_671_010))
    assert np.nanmax(found.heights) == 5.0


@pytest.mark.parametrize("name", FOLDERS)
def test_writes_the_named_file(tmp_path: Path, name: str) -> None:
    folder = tmp_path / name
    folder.mkdir()
    table = geopandas.GeoDataFrame({"id": ["a"]}, geometry=[shapely.box(0, 0, 1, 1)], crs=3067)
    with gdal_write_path(folder / "out.gpkg") as target:
        for layer in ("one", "two"):
            pyogrio.write_dataframe(table, target, layer=layer, driver="GPKG")
    assert [file.name for file in folder.iterdir()] == ["out.gpkg"]
    shutil.copy(folder / "out.gpkg", tmp_path / "plain.gpkg")
    assert pyogrio.list_layers(tmp_path / "plain.gpkg")[:, 0].tolist() == ["one", "two"]
