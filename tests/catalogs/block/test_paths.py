"""Folders and lists in place of one file, and what to do about them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from catalogs.block.declared_keys import PathKind
from catalogs.block.key_faults import validate_block_settings
from catalogs.block.paths import resolve_path
from catalogs.block.reader import read_block
from facade_core.core.errors import BlockFileError


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
        (("a.city.json", "b.city.json"), r"name a file in it, or write path: \[tiles/a.city.json, tiles/b.city.json\]"),
        (("a.png",), "name a file in it$"),
    ],
)
def test_folders_in_place_of_outlines(tmp_path: Path, names: tuple[str, ...], remedy: str) -> None:
    (tmp_path / "tiles").mkdir()
    for name in names:
        (tmp_path / "tiles" / name).touch()
    with pytest.raises(ValueError, match=f"buildings.path: .*tiles is a folder; {remedy}"):
        resolve_path("buildings.path", "tiles", tmp_path / "a.yaml", PathKind.FILE)


@pytest.mark.parametrize(("folder", "text"), [("city.gdb", "city.gdb"), ("city.gdb", "city.gdb/roads"), ("db", "db")])
def test_geodatabases_are_converted(tmp_path: Path, folder: str, text: str) -> None:
    (tmp_path / folder).mkdir()
    (tmp_path / folder / "a00000001.gdbtable").touch()
    with pytest.raises(ValueError, match=rf"it is a file geodatabase: convert it with ogr2ogr OUT\.gpkg {folder}"):
        resolve_path("buildings.path", text, tmp_path / "a.yaml", PathKind.FILE)


@pytest.mark.parametrize(
    ("key", "text", "remedy"),
    [
        ("buildings.path", "a.gpkg|layername=houses", "write path: a.gpkg, layer: houses"),
        ("buildings.path", "https://example.org/a.gpkg", "download or unpack it, and name the file"),
        ("buildings.path", "/vsizip/a.zip/a.gpkg", "download or unpack it, and name the file"),
        ("buildings.path", r"C:\data\a.gpkg", "it is a path of Windows; name the file by its path here"),
        ("buildings.path", "tiles/*.gml", "write path: [tiles/1.gml, tiles/2.gml]"),
        ("terrain.path", "tiles/*.tif", "gdalwarp tiles/*.tif joined.tif"),
        ("terrain.path", "tiles/*.asc", "no file has such a name"),
        ("streets.path", "Tiles/1.GML", "did you mean tiles/1.gml?"),
    ],
)
def test_paths_that_lead_nowhere(tmp_path: Path, key: str, text: str, remedy: str) -> None:
    (tmp_path / "tiles").mkdir()
    for name in ("1.gml", "2.gml", "1.tif"):
        (tmp_path / "tiles" / name).touch()
    kind = PathKind.RASTER if key == "terrain.path" else PathKind.FILE
    with pytest.raises(ValueError, match=re.escape(remedy)):
        resolve_path(key, text, tmp_path / "a.yaml", kind)


@pytest.mark.parametrize(
    ("section", "paths", "remedy"),
    [
        ("terrain", ["1.tif", "2.tif"], "gdalwarp 1.tif 2.tif joined.tif"),
        ("streets", ["a.gpkg", "b.gpkg"], "ogrmerge.py -single -o joined.gpkg a.gpkg b.gpkg"),
        ("streets", ["a.osm.pbf", "b.osm.pbf"], "osmium merge a.osm.pbf b.osm.pbf -o joined.osm.pbf"),
    ],
)
def test_lists_in_place_of_a_file(section: str, paths: list[str], remedy: str) -> None:
    values = {"name": "a", "buildings": {"path": "b.gpkg"}, section: {"path": paths}}
    with pytest.raises(ValueError, match=f"{section}.path: .* is a list where one file is read; .*{remedy}"):
        validate_block_settings(values)


@pytest.mark.parametrize(
    ("section", "value", "remedy"),
    [
        (
            "buildings",
            ["a.gml", "b.gml"],
            "buildings: holds a list where keys are expected; write path: [a.gml, b.gml]",
        ),
        ("buildings", [{"path": "a.gml"}], "buildings: holds a list where keys are expected; write path: [a.gml]"),
        (
            "terrain",
            ["1.tif", "2.tif"],
            "terrain: holds a list where keys are expected; make one of them with gdalwarp",
        ),
    ],
)
def test_lists_in_place_of_keys(section: str, value: object, remedy: str) -> None:
    with pytest.raises(ValueError, match=re.escape(remedy)):
        validate_block_settings({"name": "a", "buildings": {"path": "b.gpkg"}, section: value})


def test_lists_in_place_of_a_folder() -> None:
    values = {"name": "a", "buildings": {"path": "b.gpkg"}, "imagery": {"photos": {"path": ["a", "b"]}}}
    with pytest.raises(ValueError, match="a list where one folder is read; put their files into one folder"):
        validate_block_settings(values)


@pytest.mark.parametrize(
    ("name", "key", "words"),
    [
        ("a.city.json", "layer", "is of a GeoPackage, which a.city.json is not"),
        ("a.geojson", "layer", "is of a GeoPackage, which a.geojson is not"),
        ("a.gpkg", "lod", "is of CityJSON and CityGML (a GeoPackage has a layer for each), which a.gpkg is not"),
        ("a.obj", "encoding", "is the code page of a Shapefile, which a.obj is not"),
        ("a.gml", "up", "is of OBJ and PLY files, which a.gml is not"),
    ],
)
def test_keys_of_other_files_are_refused(tmp_path: Path, name: str, key: str, words: str) -> None:
    (tmp_path / name).touch()
    block = tmp_path / "block.yaml"
    value = "cp1252" if key == "encoding" else "y"
    block.write_text(f"name: a\nbuildings: {{path: {name}, {key}: {value}}}\ntexture: {{walls: translate}}\n")
    with pytest.raises(BlockFileError) as raised:
        read_block(block)
    assert str(raised.value).endswith(f"buildings.{key}: {words}; remove it")


@pytest.mark.parametrize("path", [r"data\buildings.gpkg", r"data\houses.gpkg"])
def test_backslashes_in_double_quotes_have_a_remedy(tmp_path: Path, path: str) -> None:
    block = tmp_path / "block.yaml"
    block.write_text(f'name: a\nbuildings: {{path: "{path}"}}\n')
    with pytest.raises(BlockFileError, match=r"line 2.* write paths with / \(a backslash in double quotes begins"):
        read_block(block)
