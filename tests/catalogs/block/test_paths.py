"""Folders and lists in place of one file, and what to do about them."""

from __future__ import annotations

from pathlib import Path

import pytest

from catalogs.block.declared_keys import PathKind
from catalogs.block.key_faults import validate_block_settings
from catalogs.block.paths import resolve_path


@pytest.mark.parametrize(
    ("names", "remedy"),
    [
        (("a.tif", "b.tif", "Thumbs.db"), r"make one of them with gdalwarp tiles/\*\.tif joined\.tif"),
        (("a.asc", "b.asc"), r"make one of them with gdalwarp tiles/\*\.asc joined\.tif"),
        (("notes.txt",), "name a file in it"),
    ],
)
def test_folders_in_place_of_a_file(tmp_path: Path, names: tuple[str, ...], remedy: str) -> None:
    (tmp_path / "tiles").mkdir()
    for name in names:
        (tmp_path / "tiles" / name).touch()
    with pytest.raises(ValueError, match=f"terrain.path: .*tiles is a folder; {remedy}"):
        resolve_path("terrain.path", "tiles", tmp_path / "a.yaml", PathKind.RASTER)


@pytest.mark.parametrize(
    ("names", "remedy"),
    [
        (("houses.shp", "houses.dbf", "._houses.shp"), r"name a file in it, such as tiles/houses\.shp"),
        (("a.png", "b.png"), "name a file in it$"),
    ],
)
def test_folders_in_place_of_outlines(tmp_path: Path, names: tuple[str, ...], remedy: str) -> None:
    (tmp_path / "tiles").mkdir()
    for name in names:
        (tmp_path / "tiles" / name).touch()
    with pytest.raises(ValueError, match=f"buildings.path: .*tiles is a folder; {remedy}"):
        resolve_path("buildings.path", "tiles", tmp_path / "a.yaml", PathKind.FILE)


def test_geodatabases_are_converted(tmp_path: Path) -> None:
    (tmp_path / "city.gdb").mkdir()
    with pytest.raises(ValueError, match=r"it is a file geodatabase: convert it with ogr2ogr OUT\.gpkg city\.gdb"):
        resolve_path("buildings.path", "city.gdb", tmp_path / "a.yaml", PathKind.FILE)


@pytest.mark.parametrize(
    ("section", "paths", "remedy"),
    [
        ("terrain", ["1.tif", "2.tif"], "gdalwarp 1.tif 2.tif joined.tif"),
        ("streets", ["a.gpkg", "b.gpkg"], "ogrmerge.py -single -o joined.gpkg a.gpkg b.gpkg"),
    ],
)
def test_lists_in_place_of_a_file(section: str, paths: list[str], remedy: str) -> None:
    values = {"name": "a", "buildings": {"path": "b.gpkg"}, section: {"path": paths}}
    with pytest.raises(ValueError, match=f"{section}.path: .* is a list where one file is read; .*{remedy}"):
        validate_block_settings(values)
