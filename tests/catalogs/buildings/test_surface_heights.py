"""Heights that a map does not state, measured on rasters of the surface and of the ground."""

from __future__ import annotations

from pathlib import Path

import geopandas
import numpy as np
import pytest
import rasterio
import shapely
import yaml
from rasterio.transform import from_origin

from catalogs.block.reader import read_block
from catalogs.buildings.surface_heights import measure_assumed_heights
from facade_core.core.errors import BlockFileError
from facade_core.core.types import Building, ElevationRaster, Roof

WEST, NORTH, SIZE = 386_000.0, 6_672_100.0, 100


def slope(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Ground that falls by 5 m to the east."""
    return 20.0 - 0.05 * (x - WEST) + 0.0 * y


def rasters(boxes: dict[str, tuple[shapely.Polygon, float]]) -> tuple[ElevationRaster, ElevationRaster]:
    """The surface and the ground of boxes, each with its height over the ground; both of one metre a cell."""
    x, y = np.meshgrid(WEST + 0.5 + np.arange(SIZE), NORTH - 0.5 - np.arange(SIZE))
    ground = slope(x, y)
    surface = ground.copy()
    for outline, height in boxes.values():
        surface[shapely.contains_xy(outline, x, y)] += height
    first = WEST + 0.5, NORTH - 0.5, 1.0
    return ElevationRaster(*first, surface.astype(np.float32)), ElevationRaster(*first, ground.astype(np.float32))


def box(column: int, width: int = 14) -> shapely.Polygon:
    return shapely.box(WEST + column, NORTH - 60, WEST + column + width, NORTH - 40)


BOXES = {"flat": (box(5), 12.0), "gabled": (box(25), 9.0), "gone": (box(45), 0.4), "stated": (box(65), 30.0)}


def test_what_is_assumed_is_measured_and_what_is_stated_stays() -> None:
    """An aerial of 8 m on a few cells does not count; a building that is not there keeps its height."""
    surface, ground = rasters(BOXES)
    surface.heights[50:52, 12] += 8.0
    buildings = [
        Building("flat", box(5), 6.0, "default", None, None, None, Roof("flat", 0.0)),
        Building("gabled", box(25), 6.0, "default", None, None, None, Roof("gabled", 3.0)),
        Building("gone", box(45), 6.0, "default", None, None, None, None),
        Building("stated", box(65), 15.0, "height", None, None, None, None),
        Building("outside", shapely.box(0, 0, 9, 9), 6.0, "default", None, None, None, None),
    ]
    found, notes = measure_assumed_heights(buildings, surface, ground, "dsm.tif")
    heights = {one.id: (one.height, one.height_source) for one in found}
    assert heights["flat"] == (pytest.approx(12.0, abs=0.4), "height")
    assert heights["gabled"] == (pytest.approx(6.0, abs=0.4), "height"), "its walls end three metres below its top"
    assert [heights[id] for id in ("gone", "stated", "outside")] == [
        (6.0, "default"),
        (15.0, "height"),
        (6.0, "default"),
    ]
    assert notes == (
        "heights of 2 buildings measured on dsm.tif instead of assumed",
        "1 building under 2.5 m on dsm.tif, which keep the assumed height",
        "1 building without heights on dsm.tif, which keep the assumed height",
    )


def test_a_roof_that_leaves_no_wall_is_laid_flat() -> None:
    surface, ground = rasters({"low": (box(5), 3.0)})
    building = Building("low", box(5), 6.0, "default", None, None, None, Roof("gabled", 2.0))
    ((low,), _) = measure_assumed_heights([building], surface, ground, "dsm.tif")
    assert low.roof is not None
    assert (low.roof.shape, low.roof.height, low.height) == ("flat", 0.0, pytest.approx(3.0, abs=0.4))


def test_a_block_file_names_both_rasters(tmp_path: Path) -> None:
    outlines = [outline for outline, _ in BOXES.values()]
    frame = geopandas.GeoDataFrame({"id": list(BOXES)}, geometry=outlines, crs="EPSG:3067")
    frame.to_file(tmp_path / "b.gpkg")
    for name, raster in zip(("dsm", "dtm"), rasters(BOXES), strict=True):
        profile = {"driver": "GTiff", "crs": "EPSG:3067", "dtype": "float32", "count": 1, "width": SIZE, "height": SIZE}
        with rasterio.open(
            tmp_path / f"{name}.tif", "w", transform=from_origin(WEST, NORTH, 1.0, 1.0), **profile
        ) as file:
            file.write(raster.heights[None])
    keys = {
        "name": "a",
        "buildings": {"path": "b.gpkg", "heights": {"path": "dsm.tif"}},
        "texture": {"walls": "translate"},
        "imagery": {},
    }
    path = tmp_path / "block.yaml"
    path.write_text(yaml.safe_dump(keys))
    with pytest.raises(BlockFileError, match=r"buildings\.heights\.path: .*give terrain"):
        read_block(path)
    path.write_text(yaml.safe_dump(keys | {"terrain": {"path": "dtm.tif"}}))
    block = read_block(path)
    assert [one.height_source for one in block.buildings].count("height") == 3
    tops = {one.id: one.height + (one.roof.height if one.roof else 0.0) for one in block.buildings}
    assert max(tops.values()) == pytest.approx(30.0, abs=0.5)
    assert "heights of 3 buildings measured on dsm.tif instead of assumed" in block.notes
    assumed = [one.height_source for one in block.buildings].count("default")
    assert [note.split(" buildings")[0] for note in block.notes if "state no height" in note] == (
        [f"{assumed} of {len(block.buildings)}"] if assumed else []
    )
