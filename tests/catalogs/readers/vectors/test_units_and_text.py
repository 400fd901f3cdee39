"""Units of heights, columns that are not read, and code pages of Shapefiles."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import rasterio
import shapely
from PIL import Image
from pyproj import CRS, Transformer
from shapely import LineString, Polygon

from catalogs.block.reader import read_block
from catalogs.readers.formats import read_buildings, read_centrelines
from catalogs.readers.pictures.elevation import read_elevation
from catalogs.readers.pictures.poses import read_poses_file
from catalogs.readers.pictures.source_poses import SourcePose
from catalogs.readers.source_keys import SourceKeys
from catalogs.readers.vectors.doubtful_heights import ignore_measured_minima, mark_gutter_heights
from catalogs.readers.vectors.vector_files import read_vector_footprints
from facade_core.core.errors import InputError

FOOT_FRAME = "EPSG:2263"
METRE_FRAME = "EPSG:32635"


def outlines(path: Path, crs: str | None = FOOT_FRAME, z: float | None = None, **columns: Any) -> Path:
    box = shapely.box(988_406, 211_814, 988_452, 211_844)
    shape = box if z is None else Polygon([(x, y, z) for x, y in box.exterior.coords])
    table = geopandas.GeoDataFrame({name: [value] for name, value in columns.items()}, geometry=[shape], crs=crs)
    table.to_file(path)
    return path


@pytest.mark.parametrize(
    ("columns", "crs", "height", "base"),
    [
        ({"height": 100.0}, FOOT_FRAME, 30.48, None),
        ({"height": "100"}, FOOT_FRAME, 30.48, None),
        ({"height": "30 m"}, FOOT_FRAME, 30.0, None),
        ({"height_m": 30.0}, FOOT_FRAME, 30.0, None),
        ({"bldg_hgt_cm": 3000.0}, FOOT_FRAME, 30.0, None),
        ({"height": 30.0, "osm_id": "5"}, FOOT_FRAME, 30.0, None),
        ({"height": 30.0}, f"{FOOT_FRAME}+5703", 30.0, None),
        ({"height": 30.0}, "EPSG:32618", 30.0, None),
        ({"height_ft": 100.0}, "EPSG:32618", 30.48, None),
        ({"heightroof": 100.0, "groundelev": 50.0}, "EPSG:32618", 30.48, 15.24),
        ({"height_roof": 100.0, "ground_elevation": 50.0}, FOOT_FRAME, 30.48, 15.24),
        ({"height": 30.0, "ground_elevation": -1.5}, "EPSG:32618", 30.0, -1.5),
        ({"height": 30.0, "groundelev": -9999.0}, "EPSG:32618", 30.0, None),
    ],
)
def test_heights_have_their_own_unit_or_that_of_the_frame(
    tmp_path: Path, columns: dict[str, Any], crs: str, height: float, base: float | None
) -> None:
    found = read_vector_footprints(outlines(tmp_path / "b.gpkg", crs, **columns))
    (item,) = found.items
    assert item.height == pytest.approx(height, abs=0.001)
    assert item.base == (None if base is None else pytest.approx(base, abs=0.001))
    assert bool(found.remarks) == (crs == FOOT_FRAME and columns.get("height") in (100.0, "100", "30 m"))


def test_z_and_a_given_frame_count_in_feet_too(tmp_path: Path) -> None:
    found = read_vector_footprints(outlines(tmp_path / "z.gpkg", z=50.0, height_m=9.0))
    assert found.items[0].base == pytest.approx(15.24, abs=0.001)
    assert [remark.id for remark in found.remarks] == ["z"]
    path = outlines(tmp_path / "bare.gpkg", None, height=100.0)
    assert read_vector_footprints(path).items[0].height == 100.0
    given = read_buildings(path, None, SourceKeys(crs=FOOT_FRAME))
    assert getattr(given.items[0], "height", None) == pytest.approx(30.48, abs=0.001)


def test_a_model_in_a_given_foot_frame(tmp_path: Path) -> None:
    corners = [(0, 0), (40, 0), (40, 30), (0, 30)]
    lines = ["g house", *(f"v {x + 988_406} {y + 211_814} {z}" for z in (0, 100) for x, y in corners)]
    faces = ["4 3 2 1", "5 6 7 8", *(f"{i + 1} {(i + 1) % 4 + 1} {(i + 1) % 4 + 5} {i + 5}" for i in range(4))]
    (tmp_path / "b.obj").write_text("\n".join([*lines, *(f"f {face}" for face in faces), ""]))
    found = read_buildings(tmp_path / "b.obj", None, SourceKeys(crs=FOOT_FRAME))
    assert "z" in [remark.id for remark in found.remarks]
    assert found.items[0].shell.vertices[:, 2].max() == pytest.approx(30.48, abs=0.001)


@pytest.mark.parametrize(
    ("columns", "named"),
    [
        ({"roofhgt7": 12.5, "shape_area": 120.0, "objectid": 7}, ["roofhgt7", "shape_area"]),
        ({"hoyde": 12, "elev_top": 30}, ["hoyde", "elev_top"]),
        ({"height": None, "dachhoehe": 12.0}, ["dachhoehe"]),
        ({"height": 9.0, "elev_top": 30.0}, []),
        ({"levels": 4, "elev_top": 30.0}, []),
    ],
)
def test_unread_columns_of_numbers_are_named(tmp_path: Path, columns: dict[str, Any], named: list[str]) -> None:
    found = read_vector_footprints(outlines(tmp_path / "b.gpkg", "EPSG:32618", **columns))
    assert [remark.id for remark in found.remarks] == named
    assert all("b.gpkg with numbers that are not read" in remark.reason for remark in found.remarks)


@pytest.mark.parametrize(
    ("columns", "doubt"),
    [
        ({"height": [125.0, 90.0, 75.0], "levels": [4, 3, 2]}, "31.2 a storey; call the column by its unit"),
        ({"height": [42.0, 31.0, 21.0], "levels": [4, 3, 2]}, "10.5 a storey; call the column by its unit (height_ft"),
        ({"height": [42.0, 31.0, 21.0], "osm_id": [1, 2, 3], "levels": [4, 3, 2]}, "10.5 a storey"),
        ({"height": [4.0, 3.0, 5.0], "levels": [4, 3, 5]}, "1.0 a storey; call the column by its unit"),
        ({"height": [900.0, 850.0, 750.0]}, "850 on the median; call the column by its unit (height_ft, height_cm"),
        ({"height": [182.0, 179.0, 177.0], "ground_z": [170.0, 170.5, 170.0]}, "just above the heights of the ground"),
        ({"height": [12.0, 9.0, 6.0], "ground_z": [170.0, 170.5, 170.0]}, None),
        ({"height": [12.0, 9.0, 6.0], "levels": [4, 3, 2]}, None),
        ({"height": [12.0, 9.0, 6.0]}, None),
        ({"height_ft": [42.0, 31.0, 21.0]}, None),
        ({"height_m": [42.0, 31.0, 21.0], "levels": [4, 3, 2]}, None),
        ({"height": ["42 m", "31 m", "21 m"]}, None),
    ],
)
def test_heights_that_contradict_others_are_noted(
    tmp_path: Path, columns: dict[str, list[Any]], doubt: str | None
) -> None:
    boxes = [shapely.box(x, 0, x + 12, 10) for x in (0, 20, 40)]
    geopandas.GeoDataFrame(columns, geometry=boxes, crs="EPSG:32635").to_file(tmp_path / "b.gpkg")
    found = read_vector_footprints(tmp_path / "b.gpkg")
    assert bool(found.remarks) == (doubt is not None)
    assert all(str(doubt) in remark.reason for remark in found.remarks)
    if doubt is not None:  # noted, not changed
        assert [item.height for item in found.items] == columns["height"]


def street(folder: Path, name: bytes, page: str | None = None, driver: int = 0) -> Path:
    """Write a Shapefile whose only name has these bytes."""
    path = folder / "s.shp"
    line = LineString([(385_000, 6_671_000), (385_050, 6_671_000)])
    geopandas.GeoDataFrame({"name": ["x" * len(name)]}, geometry=[line], crs="EPSG:32635").to_file(path)
    table = bytearray((folder / "s.dbf").read_bytes())
    table[29] = driver
    place = bytes(table).rindex(b"x" * len(name))
    table[place : place + len(name)] = name
    (folder / "s.dbf").write_bytes(table)
    (folder / "s.cpg").unlink()
    if page is not None:
        (folder / "s.cpg").write_text(page)
    return path


@pytest.mark.parametrize(
    ("text", "written", "page", "driver", "noted"),
    [
        ("Hämeentie", "utf-8", None, 0, False),
        ("Hämeentie", "utf-8", None, 87, False),
        ("Hämeentie", "utf-8", "UTF-8", 0, False),
        ("Hämeentie", "utf-8", "ISO-8859-1", 0, True),
        ("Hämeentie", "utf-8", "no such page", 0, True),
        ("Hämeentie", "cp1252", "1252", 0, False),
        ("Hämeentie", "cp1252", "ANSI 1252", 0, False),
        ("Hämeentie", "latin-1", "88591", 0, False),
        ("Hämeentie", "cp1252", None, 3, False),
        ("Hämeentie", "cp1252", None, 0, True),
        ("Café", "cp1252", None, 87, True),
        ("Невский", "cp1251", "1251", 0, False),
        ("Невский", "cp1251", None, 201, False),
        ("銀座通り", "cp932", None, 19, False),
        ("Main Street", "ascii", "no such page", 0, False),
    ],
)
def test_the_code_page_is_stated_or_found(
    tmp_path: Path, text: str, written: str, page: str | None, driver: int, noted: bool
) -> None:
    found = read_centrelines(street(tmp_path, text.encode(written), page, driver))
    assert [item.name for item in found.items] == [text]
    assert bool(found.remarks) == noted


def test_a_given_code_page_counts(tmp_path: Path) -> None:
    path = street(tmp_path, "Невский".encode("cp1251"))
    assert read_centrelines(path, SourceKeys(encoding="windows-1251")).items[0].name == "Невский"
    with pytest.raises(InputError, match="its text is not UTF-8; give another encoding"):
        read_centrelines(path, SourceKeys(encoding="UTF-8"))


@pytest.mark.parametrize("page", ["UTF-8", "no such page"])
def test_the_refusal_names_the_page_file(tmp_path: Path, page: str) -> None:
    with pytest.raises(InputError, match=r"s\.cpg beside it states.*give encoding: windows-1252"):
        read_centrelines(street(tmp_path, b"H\xe4meentie", page))


def write_block(folder: Path, buildings: str = "buildings.gpkg", streets: str = "streets.gpkg") -> Path:
    """Write a block file beside its buildings and streets, with a plain exemplar."""
    (folder / "exemplars").mkdir()
    Image.fromarray(np.full((60, 40, 3), 180, np.uint8)).save(folder / "exemplars" / "plaster.png")
    block = folder / "block.yaml"
    block.write_text(
        f"name: {folder.name}\nbuildings: {{path: '{buildings}'}}\nstreets: {{path: '{streets}'}}\n"
        "imagery:\n  exemplars: {path: exemplars}\n"
    )
    return block


def write_layer(path: Path, shapes: list[Any], crs: str, **columns: list[Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    plain = path.parent.parent / path.name  # libraries take a '!' in a folder's name for a separator
    geopandas.GeoDataFrame(columns, geometry=shapes, crs=crs).to_file(plain)
    plain.rename(path)


@pytest.mark.parametrize(
    ("columns", "base"),
    [
        ({"id": ["1", "2"], "height": [98.4, 131.2]}, None),
        (
            {
                "bin": ["1015862", "1015863"],
                "heightroof": [98.425, 131.2333],
                "groundelev": [50.0, 50.0],
            },
            15.24,
        ),
    ],
)
def test_blocks_in_feet(tmp_path: Path, columns: dict[str, Any], base: float | None) -> None:
    houses = [shapely.box(988_406, 211_814, 988_452, 211_844), shapely.box(988_472, 211_814, 988_512, 211_844)]
    write_layer(tmp_path / "buildings.gpkg", houses, FOOT_FRAME, **columns)
    street = LineString([(988_376, 211_794), (988_566, 211_794)])
    write_layer(tmp_path / "streets.gpkg", [street], FOOT_FRAME, id=["1"], name=["W 34 St"])
    block = read_block(write_block(tmp_path))
    assert any("unit of its frame" in note for note in block.notes) == ("height" in columns)
    assert [building.id for building in block.buildings] == list(columns.get("bin", columns.get("id", [])))
    assert [building.base for building in block.buildings] == (
        [None, None] if base is None else pytest.approx([base, base])
    )
    assert [b.height + b.roof.height for b in block.buildings if b.roof] == pytest.approx([30.0, 40.0], abs=0.05)


def write_houses(path: Path) -> None:
    houses = [shapely.box(x, 6_671_006, x + 12, 6_671_018) for x in (385_005, 385_025)]
    write_layer(path, houses, METRE_FRAME, id=["a", "b"], height=[9.0, 12.0])


def test_a_shapefile_without_a_code_page(tmp_path: Path) -> None:
    write_houses(tmp_path / "buildings.gpkg")
    street(tmp_path, "Hämeentie".encode())
    assert [one.name for one in read_block(write_block(tmp_path, streets="s.shp")).streets] == ["Hämeentie"]


@pytest.mark.parametrize("is_other_there", [False, True])
def test_a_path_with_a_separator(tmp_path: Path, is_other_there: bool) -> None:
    """A '!' separates an archive from its member in paths of libraries; a folder may be called so."""
    write_houses(tmp_path / "!Projekte" / "houses.gpkg")
    if is_other_there:
        other = [shapely.box(385_005, 6_671_006, 385_010, 6_671_012)]
        write_layer(tmp_path / "Projekte" / "houses.gpkg", other, METRE_FRAME, id=["other"], height=[5.0])
    write_layer(tmp_path / "streets.gpkg", [LineString([(384_990, 6_671_000), (385_050, 6_671_000)])], METRE_FRAME)
    block = read_block(write_block(tmp_path, buildings="!Projekte/houses.gpkg"))
    assert [building.id for building in block.buildings] == ["a", "b"]


@pytest.mark.parametrize(("frame", "metres"), [("EPSG:3067", 1.0), (FOOT_FRAME, 0.3048006)])
@pytest.mark.parametrize("name", ["s.gpkg", "s.geojson", "s.shp"])
def test_a_passage_through_a_building_has_its_tags(tmp_path: Path, name: str, frame: str, metres: float) -> None:
    lines = [LineString([(0, y), (0, y + 10)]) for y in (0, 10, 20)]
    columns = {
        "id": ["a", "b", "c"],
        "class": ["residential"] * 3,
        "tunnel": [None, "Building Passage", "no"],
        "maxheight": [None, "3.2", None],
        "width": [None, "4 m", None],
    }
    geopandas.GeoDataFrame(columns, geometry=lines, crs=frame).to_file(tmp_path / name)
    found = read_centrelines(tmp_path / name, SourceKeys(frame))
    assert [(item.id, item.passage is not None) for item in found.items] == [("a", False), ("b", True), ("c", False)]
    tags = dict(found.items[1].passage or {})
    assert tags["highway"] == "residential"
    assert tags["width"] == "4 m"
    assert float(tags["maxheight"]) == pytest.approx(3.2 * metres, abs=1e-3)


def test_a_block_with_a_passage(tmp_path: Path) -> None:
    houses = [shapely.box(385_000, 6_671_008, 385_040, 6_671_018), shapely.box(385_000, 6_671_034, 385_040, 6_671_042)]
    write_layer(tmp_path / "buildings.gpkg", houses, METRE_FRAME, id=["long", "yard"], height=[15, 9])
    middle = [(385_020, 6_671_000 + y) for y in (0, 8, 18, 30)]
    ways = [[(384_990, 6_671_000), (385_050, 6_671_000)], *([a, b] for a, b in pairwise(middle))]
    write_layer(
        tmp_path / "streets.gpkg",
        [LineString(way) for way in ways],
        METRE_FRAME,
        id=["1", "2", "3", "4"],
        name=["Street", "Hof", "Hof", "Hof"],
        highway=["residential"] * 4,
        tunnel=[None, None, "building_passage", None],
    )
    block = read_block(write_block(tmp_path))
    assert [street.id for street in block.streets] == ["s1", "s2"]
    assert "passages through buildings opened to an assumed height of 3.5 m: 1 (3)" in block.notes
    ((height, corridor),) = ((one.height, one.corridor) for b in block.buildings for one in b.passages)
    assert height == 3.5
    assert corridor.intersection(block.buildings[0].footprint).equals(shapely.box(385017, 6671008, 385023, 6671018))


@pytest.mark.parametrize(("crs", "height"), [(FOOT_FRAME, 30.48), (f"{FOOT_FRAME}+5703", 100.0)])
def test_terrain_in_a_foot_frame(tmp_path: Path, crs: str, height: float) -> None:
    profile = {"width": 60, "height": 60, "count": 1, "dtype": "float32", "crs": CRS(crs).to_wkt()}
    place = rasterio.Affine(10, 0, 988_200, 0, -10, 212_100)
    with rasterio.open(tmp_path / "dem.tif", "w", "GTiff", transform=place, **profile) as raster:
        raster.write(np.full((60, 60), 100.0, np.float32), 1)
    to_frame = Transformer.from_crs(FOOT_FRAME, 32618, always_xy=True).transform
    x, y = to_frame(988_450, 211_820)
    found = read_elevation(tmp_path / "dem.tif", CRS(32618), (x - 5, y - 5, x + 5, y + 5))
    assert np.nanmean(found.heights) == pytest.approx(height, abs=0.01)


def test_a_camera_in_a_foot_frame(tmp_path: Path) -> None:
    pose = {"x": 988_450.0, "y": 211_820.0, "z": 100.0, "heading": 0.0}
    (tmp_path / "poses.json").write_text(json.dumps({"crs": FOOT_FRAME, "poses": {"a.jpg": pose}}))
    found = read_poses_file(tmp_path / "poses.json").poses["a.jpg"]
    assert isinstance(found, SourcePose)
    assert found.z == pytest.approx(30.48, abs=0.001)


@pytest.mark.parametrize("code", [999, 9999.0, -9999, "99999"])
def test_codes_of_unknown_heights_are_no_heights(tmp_path: Path, code: Any) -> None:
    boxes = [shapely.box(x, 60, x + 1e-4, 60.0001) for x in (24.0, 24.0002)]
    columns = {"height_cm": ["900", str(code)]}
    geopandas.GeoDataFrame(columns, geometry=boxes, crs="EPSG:4326").to_file(tmp_path / "a.gpkg")
    found = read_vector_footprints(tmp_path / "a.gpkg")
    assert [item.height for item in found.items] == [9.0, None]
    assert "heights not understood and ignored" in {remark.reason for remark in found.remarks}


def test_least_heights_of_roofs_are_no_lower_ends() -> None:
    tags = [{"height": "12", "min_height": "10"}, {"height": "9"}]
    assert ignore_measured_minima(tags, {"height": "height", "min_height": "min_height"}, "b.gpkg") == []
    (remark,) = ignore_measured_minima(tags, {"avg_height": "AVG_HEIGHT", "min_height": "MIN_HEIGHT"}, "b.gpkg")
    assert tags == [{"height": "12"}, {"height": "9"}]
    assert (remark.id, "least heights of b.gpkg" in remark.reason) == ("1 buildings", True)


def test_heights_of_the_french_map_reach_to_the_gutter() -> None:
    tags = [{"height": "9"}, {}]
    mark_gutter_heights(tags, {"hauteur": "HAUTEUR"})
    assert tags == [{"height": "9"}, {}]
    mark_gutter_heights(tags, {"hauteur": "HAUTEUR", "z_min_sol": "Z_MIN_SOL"})
    assert tags == [{"height:eaves": "9"}, {}]
