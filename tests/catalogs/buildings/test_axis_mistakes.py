"""Swapped axes, and numbers of zones in eastings, are recognised and named."""

from __future__ import annotations

from pathlib import Path

import geopandas
import numpy as np
import pytest
import shapely
import shapely.affinity
from pyproj import CRS

from catalogs.block.reader import read_block
from catalogs.buildings.axis_mistakes import (
    axis_mistake,
    looks_like_degrees,
    note_local_coordinates,
    swapped_places,
)
from catalogs.buildings.extents import locate_boxes
from catalogs.crs import note_outside_area_of_use
from facade_core.core.errors import BlockFileError, InputError


@pytest.mark.parametrize(
    ("crs", "x", "y", "mistake"),
    [
        ("EPSG:32635", 6_671_000, 385_000, "x and y look swapped (the first number is 6671005, the second 385005)"),
        ("EPSG:28992", 487_000, 121_000, "x and y look swapped"),
        ("EPSG:4326", 35.0, 139.0, "longitude and latitude look swapped"),
        ("EPSG:4258", 60.16, 24.93, "longitude and latitude look swapped"),
    ],
)
def test_mistakes_are_named(crs: str, x: float, y: float, mistake: str) -> None:
    size = 0.001 if CRS(crs).is_geographic else 10
    boxes = np.array([[x, y, x + size, y + size]])
    assert mistake in str(axis_mistake(CRS(crs), boxes))
    with pytest.raises(InputError, match="look swapped"):
        locate_boxes(crs, boxes)


@pytest.mark.parametrize(
    ("crs", "x", "y"),
    [
        ("EPSG:25832", 384_000, 5_500_000),
        ("EPSG:4647", 32_384_000, 5_500_000),
        ("EPSG:3879", 25_497_000, 6_671_000),
        ("EPSG:3857", 2_776_000, 8_437_000),
        ("EPSG:32635", 385_000, 6_671_000),
        ("EPSG:5514", -743_000, -1_043_000),
        ("EPSG:4326", 139.0, 35.0),
        ("EPSG:4326", 179.99, -17.0),
        ("EPSG:32635", 1e12, 1e12),
    ],
)
def test_right_and_hopeless_coordinates_are_no_mistake(crs: str, x: float, y: float) -> None:
    assert axis_mistake(CRS(crs), np.array([[x, y, x + 0.01, y + 0.01]])) is None


@pytest.mark.parametrize(
    ("crs", "box", "mistake"),
    [
        ("EPSG:32635", (24.93, 60.16, 24.9302, 60.1601), "look like degrees"),
        ("EPSG:3857", (24.93, 60.16, 24.9302, 60.1601), "look like degrees"),
        ("EPSG:31370", (150_000.0, 170_000.0, 150_012.0, 170_009.0), None),
    ],
)
def test_degrees_in_a_frame_of_metres_are_named(crs: str, box: tuple[float, ...], mistake: str | None) -> None:
    found = axis_mistake(CRS(crs), np.array([box]))
    assert found is None if mistake is None else mistake in str(found)


@pytest.mark.parametrize(
    ("crs", "extent", "is_local"),
    [
        ("EPSG:32635", (0.0, 6.0, 12.0, 15.0), True),
        ("EPSG:2154", (-30.0, 6.0, 12.0, 15.0), True),
        ("EPSG:32635", (385_000.0, 6_671_000.0, 385_100.0, 6_671_100.0), False),
        ("EPSG:5514", (-743_000.0, -1_043_000.0, -742_000.0, -1_042_000.0), False),
    ],
)
def test_local_coordinates_are_noted(crs: str, extent: tuple[float, ...], is_local: bool) -> None:
    assert bool(note_local_coordinates(CRS(crs), extent)) == is_local


def test_one_right_building_is_enough() -> None:
    boxes = np.array([[385_000, 6_671_000, 385_010, 6_671_010], [6_671_000, 385_000, 6_671_010, 385_010.0]])
    assert axis_mistake(CRS("EPSG:32635"), boxes) is None


def test_swapped_places() -> None:
    here = np.array([24.92, 60.15, 24.93, 60.16])
    assert swapped_places(here, here[[1, 0, 3, 2]])
    assert not swapped_places(here, here)
    assert not swapped_places(here, np.array([26.0, 60.15, 26.1, 60.16]))


def test_latlon_swapped(data: Path) -> None:
    folder = data / "field_inputs" / "latlon-swapped"
    if not folder.is_dir():
        pytest.skip("no field inputs in the data folder")
    with pytest.raises(BlockFileError, match=r"longitude and latitude look swapped.*buildings\.geojson"):
        read_block(folder / "block.yaml")


def test_degrees_are_told_by_range_and_size() -> None:
    assert looks_like_degrees(np.array([[24.93, 60.16, 24.9302, 60.1601]]))
    assert not looks_like_degrees(np.array([[385_000.0, 6_672_000, 385_012, 6_672_010]]))
    assert not looks_like_degrees(np.empty((0, 4)))


def test_degrees_without_a_frame_are_named(tmp_path: Path) -> None:
    table = geopandas.GeoDataFrame({"height": [9.0]}, geometry=[shapely.box(24.93, 60.16, 24.9302, 60.1601)])
    table.to_file(tmp_path / "b.shp")
    (tmp_path / "block.yaml").write_text("name: b\nbuildings: {path: b.shp}\ntexture: {walls: translate}\n")
    with pytest.raises(BlockFileError, match="look like degrees: write buildings"):
        read_block(tmp_path / "block.yaml")


def test_an_offset_out_of_the_area_of_use_is_noted(tmp_path: Path) -> None:
    table = geopandas.GeoDataFrame(
        {"height": [9.0]}, geometry=[shapely.box(385_000, 6_672_000, 385_012, 6_672_010)], crs=3067
    )
    table.to_file(tmp_path / "b.gpkg")
    text = "name: b\nbuildings: {path: b.gpkg, offset: [385000, 6672000, 0]}\ntexture: {walls: translate}\n"
    (tmp_path / "block.yaml").write_text(text)
    assert any("far from where EPSG:3067" in note for note in read_block(tmp_path / "block.yaml").notes)


@pytest.mark.parametrize(
    ("crs", "longitude", "is_noted"),
    [("EPSG:4326", 24.9, False), ("EPSG:3067", 24.9, False), ("EPSG:3067", -70.0, True), ("EPSG:3832", -170.0, False)],
)
def test_a_place_is_noted_outside_the_area_of_use_alone(crs: str, longitude: float, is_noted: bool) -> None:
    """EPSG:4326 covers all longitudes; that of EPSG:3832 begins in the east and ends beyond the antimeridian."""
    assert bool(note_outside_area_of_use(CRS(crs), longitude, 60.0)) == is_noted
