"""Elevation rasters: small ones written here, in several frames and formats."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import rasterio.shutil
from PIL import Image
from pyproj import CRS, Transformer
from rasterio.transform import from_origin

from catalogs.readers.pictures import elevation
from catalogs.readers.pictures.elevation import note_assumed_unit, read_elevation
from catalogs.readers.settings import PICTURES
from facade_core.core.errors import InputError
from facade_core.core.types import ElevationRaster

UTM = CRS.from_epsg(32635)
WEST, NORTH = 385_000.0, 6_672_000.0
BOX = (385_100.0, 6_671_700.0, 385_160.0, 6_671_760.0)


def plane(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 20 + 0.01 * (x - WEST) - 0.02 * (y - NORTH)


def write(
    path: Path, heights: np.ndarray, step: float = 2.0, west: float = WEST, north: float = NORTH, **options: Any
) -> Path:
    bands = heights if heights.ndim == 3 else heights[None]
    profile = {
        "driver": "GTiff",
        "crs": "EPSG:32635",
        "dtype": bands.dtype,
        "transform": from_origin(west, north, step, step),
    }
    with rasterio.open(
        path, "w", count=len(bands), height=bands.shape[1], width=bands.shape[2], **(profile | options)
    ) as raster:
        raster.write(bands)
    return path


def tilted(step: float = 2.0, size: float = 400.0) -> np.ndarray:
    at = np.arange(step / 2, size, step)
    return plane(WEST + at[None], NORTH - at[:, None]).astype(np.float32)


def places(found: ElevationRaster) -> tuple[np.ndarray, np.ndarray]:
    rows, columns = found.heights.shape
    return found.x + found.step * np.arange(columns)[None], found.y - found.step * np.arange(rows)[:, None]


def check_covers(found: ElevationRaster) -> None:
    x, y = places(found)
    assert x[0, 0] <= BOX[0] <= BOX[2] <= x[0, -1]
    assert y[-1, 0] <= BOX[1] <= BOX[3] <= y[0, 0]


def test_heights_in_the_same_frame_are_taken_over_as_they_are(tmp_path: Path) -> None:
    found = read_elevation(write(tmp_path / "dem.tif", tilted()), UTM, BOX)
    assert found.step == 2.0
    assert found.heights.shape == (36, 36), "60 m at 2 m and a margin, not the whole raster"
    check_covers(found)
    np.testing.assert_allclose(found.heights, plane(*places(found)), atol=1e-4)
    assert (found.x - WEST) % 2 == 1.0, "cell centres are the raster's"


def test_degrees_are_warped_into_the_frame(tmp_path: Path) -> None:
    to_utm = Transformer.from_crs(4326, UTM, always_xy=True)
    west, north = to_utm.transform(WEST, NORTH, direction="INVERSE")
    step = 2e-5
    longitude, latitude = np.meshgrid(west + step * (np.arange(400) + 0.5), north - step * (np.arange(300) + 0.5))
    heights = plane(*to_utm.transform(longitude, latitude)).astype(np.float32)
    found = read_elevation(write(tmp_path / "dem.tif", heights, step, west, north, crs="EPSG:4326"), UTM, BOX)
    assert found.step == pytest.approx(2e-5 * 111_320 * np.cos(np.radians(north)), rel=0.01)
    check_covers(found)
    np.testing.assert_allclose(found.heights, plane(*places(found)), atol=0.03)


def test_fine_and_vast_rasters_become_coarser(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path / "dem.tif", tilted(0.5), 0.5)
    found = read_elevation(path, UTM, BOX)
    assert found.step == PICTURES.min_elevation_cell_m
    np.testing.assert_allclose(found.heights, plane(*places(found)), atol=0.01)
    monkeypatch.setattr(elevation, "PICTURES", replace(PICTURES, max_elevation_cells=400))
    found = read_elevation(path, UTM, BOX)
    assert found.heights.size <= 400
    check_covers(found)
    np.testing.assert_allclose(found.heights, plane(*places(found)), atol=0.1)


@pytest.mark.parametrize("declared", [True, False])
def test_unknown_heights_are_nan(tmp_path: Path, declared: bool) -> None:
    heights = tilted()
    heights[130:140, 60:70] = -9999.0
    found = read_elevation(write(tmp_path / "dem.tif", heights, nodata=-9999.0 if declared else None), UTM, BOX)
    unknown = np.isnan(found.heights)
    assert unknown.sum() == 100
    np.testing.assert_allclose(found.heights[~unknown], plane(*places(found))[~unknown], atol=1e-4)


def test_the_first_band_counts_in_whatever_unit(tmp_path: Path) -> None:
    bands = np.stack([tilted() / 0.3048, np.zeros((200, 200), np.float32)])
    path = write(tmp_path / "dem.tif", bands)
    with rasterio.open(path, "r+") as raster:
        raster.units = ("ft", "m")
    found = read_elevation(path, UTM, BOX)
    np.testing.assert_allclose(found.heights, plane(*places(found)), atol=1e-3)
    centimetres = write(tmp_path / "cm.tif", np.round(tilted() * 100).astype(np.int16))
    with rasterio.open(centimetres, "r+") as raster:
        raster.scales = (0.01,)
    found = read_elevation(centimetres, UTM, BOX)
    np.testing.assert_allclose(found.heights, plane(*places(found)), atol=0.01)


def test_heights_in_a_smaller_unit_that_is_not_stated_are_refused(tmp_path: Path) -> None:
    steps = write(tmp_path / "centimetres.tif", np.round(tilted() * 100).astype(np.int16))
    with pytest.raises(InputError, match=r"centimetres\.tif: half of its cells rise more than 2.2 m a metre"):
        read_elevation(steps, UTM, BOX)
    towers = tilted()
    towers[::8, ::8] += 90  # a surface model of thin towers is no such thing
    assert read_elevation(write(tmp_path / "towers.tif", towers), UTM, BOX).heights.max() > 100


@pytest.mark.parametrize(("driver", "name"), [("AAIGrid", "dem.asc"), ("HFA", "dem.img")])
def test_other_formats(tmp_path: Path, driver: str, name: str) -> None:
    with rasterio.open(write(tmp_path / "dem.tif", tilted())) as raster:
        rasterio.shutil.copy(raster, tmp_path / name, driver=driver)
    found = read_elevation(tmp_path / name, UTM, BOX)
    np.testing.assert_allclose(found.heights, plane(*places(found)), atol=1e-3)


def vrt(path: Path, source: str, relative: int = 1) -> Path:
    size = 'xOff="0" yOff="0" xSize="200" ySize="200"'
    path.write_text(
        f'<VRTDataset rasterXSize="200" rasterYSize="200"><SRS>EPSG:32635</SRS>'
        f"<GeoTransform>{WEST}, 2, 0, {NORTH}, 0, -2</GeoTransform>"
        f'<VRTRasterBand dataType="Float32" band="1"><SimpleSource>'
        f'<SourceFilename relativeToVRT="{relative}">{source}</SourceFilename><SourceBand>1</SourceBand>'
        f"<SrcRect {size}/><DstRect {size}/></SimpleSource></VRTRasterBand></VRTDataset>"
    )
    return path


def test_a_virtual_raster_of_files_here(tmp_path: Path) -> None:
    write(tmp_path / "tile.tif", tilted())
    found = read_elevation(vrt(tmp_path / "dem.vrt", "tile.tif"), UTM, BOX)
    np.testing.assert_allclose(found.heights, plane(*places(found)), atol=1e-3)


@pytest.mark.parametrize(
    "source", ["/vsicurl/http://localhost/a.tif", "http://localhost/a.tif", "WMS:localhost", "no.tif"]
)
def test_addresses_in_a_virtual_raster_are_refused(tmp_path: Path, source: str) -> None:
    with pytest.raises(InputError, match=r"dem\.vrt is put together from .*give one GeoTIFF"):
        read_elevation(vrt(tmp_path / "dem.vrt", source, relative=0), UTM, BOX)
    (tmp_path / "inner").mkdir()
    vrt(tmp_path / "inner" / "inner.vrt", source, relative=0)
    with pytest.raises(InputError, match=r"inner\.vrt is put together from"):
        read_elevation(vrt(tmp_path / "dem.vrt", "inner/inner.vrt"), UTM, BOX)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"these are no heights", "cannot be read as a raster"),
        (b"", "cannot be read as a raster"),
        (b"<GDAL_WMS><Service/></GDAL_WMS>", r"is XML \(GDAL_WMS\), no raster"),
        (b'<!DOCTYPE a [<!ENTITY b "c">]><VRTDataset>&b;</VRTDataset>', "is no raster"),
        (b"<VRTDataset>", "is no raster"),
        (b'{"type": "FeatureCollection"}', "is JSON"),
    ],
)
def test_what_is_no_raster_is_refused(tmp_path: Path, content: bytes, reason: str) -> None:
    (tmp_path / "dem.tif").write_bytes(content)
    with pytest.raises(InputError, match=rf"dem\.tif {reason}.*; (give|convert)") as raised:
        read_elevation(tmp_path / "dem.tif", UTM, BOX)
    assert "\n" not in str(raised.value)


def test_a_truncated_raster_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "dem.tif", tilted())
    path.write_bytes(path.read_bytes()[:60_000])
    with pytest.raises(InputError, match=r"dem\.tif has damaged cells around"):
        read_elevation(path, UTM, BOX)


def test_a_raster_without_a_frame_or_of_another_place_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere\.tif is no file"):
        read_elevation(tmp_path / "nowhere.tif", UTM, BOX)
    with pytest.raises(InputError, match=r"states no frame; put its"):
        read_elevation(write(tmp_path / "bare.tif", tilted(), crs=None), UTM, BOX)
    with pytest.raises(InputError, match=r"states no place on the ground; put its"):
        read_elevation(write(tmp_path / "lost.tif", tilted(), transform=rasterio.Affine.identity()), UTM, BOX)
    with pytest.raises(InputError, match=r"does not cover the block \[385100, .*it spans \[384000, .* in EPSG:32635"):
        read_elevation(write(tmp_path / "west.tif", tilted(), west=384_000.0), UTM, BOX)
    nothing = np.full((200, 200), np.nan, np.float32)
    with pytest.raises(InputError, match=r"has no known height inside the block"):
        read_elevation(write(tmp_path / "nothing.tif", nothing), UTM, BOX)
    with pytest.raises(InputError, match=r"bounds .* are no box"):
        read_elevation(tmp_path / "west.tif", UTM, (0, 0, np.nan, 1))


def test_a_raster_that_covers_a_part_is_nan_beyond_it(tmp_path: Path) -> None:
    found = read_elevation(write(tmp_path / "dem.tif", tilted()[:, :64]), UTM, BOX)
    known = np.isfinite(found.heights)
    x, _ = places(found)
    assert known[:, x[0] < WEST + 128].all()
    assert not known[:, x[0] > WEST + 130].any()


@pytest.mark.parametrize("compress", ["deflate", "lzw"])
def test_damaged_cells_are_named_by_their_place(compress: str, tmp_path: Path) -> None:
    heights = np.random.default_rng(0).normal(10, 1, (512, 512)).astype(np.float32)
    tiles = {"tiled": True, "blockxsize": 128, "blockysize": 128, "compress": compress}
    path = write(tmp_path / "a.tif", heights, 1.0, **tiles)
    with Image.open(path) as image:
        offset = image.tag_v2[324][2 * 4 + 1]  # TileOffsets: third row, second column
    content = bytearray(path.read_bytes())
    content[offset : offset + 300] = b"\xff" * 300
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"has damaged cells around 385192, 6671680 \(EPSG:32635\), in the surr"):
        read_elevation(path, UTM, (WEST + 100, NORTH - 400, WEST + 300, NORTH - 200))
    assert np.isfinite(read_elevation(path, UTM, (WEST + 300, NORTH - 100, WEST + 400, NORTH - 50)).heights).any()


def test_the_level_of_the_sea_is_a_height(tmp_path: Path) -> None:
    heights = np.linspace(0, 40, 200, dtype=np.float32)[None].repeat(200, axis=0)
    heights[:, :60] = 0
    assert np.isfinite(read_elevation(write(tmp_path / "t.tif", heights), UTM, BOX).heights).all()


def test_a_picture_is_no_elevation_model(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="3 bands of 8 bits, which is a picture"):
        read_elevation(write(tmp_path / "t.tif", np.full((3, 200, 200), 9, np.uint8)), UTM, BOX)


@pytest.mark.parametrize(
    ("name", "metres"),
    [
        ("US survey foot", 0.3048), ("Feet (US)", 0.3048), ("foot_US", 0.3048), ("international foot", 0.3048),
        ("ftUS", 0.3048),
        ("centimeters", 0.01), ("millimetre", 0.001), ("dm", 0.1), ("metre", 1.0), ("metres above sea level", 1.0),
    ],
)  # fmt: skip
def test_units_of_a_band_by_their_words(tmp_path: Path, name: str, metres: float) -> None:
    path = write(tmp_path / "t.tif", tilted() / metres)
    with rasterio.open(path, "r+") as raster:
        raster.units = (name,)
    found = read_elevation(path, UTM, BOX)
    np.testing.assert_allclose(found.heights, plane(*places(found)), atol=0.01)
    assert note_assumed_unit(path) == ()


@pytest.mark.parametrize(
    ("crs", "unit", "is_noted"), [("EPSG:2263", None, True), ("EPSG:2263", "m", False), (UTM, None, False)]
)
def test_the_unit_of_the_frame_is_noted(tmp_path: Path, crs: CRS | str, unit: str | None, is_noted: bool) -> None:
    path = write(tmp_path / "t.tif", tilted(), crs=crs)
    if unit is not None:
        with rasterio.open(path, "r+") as raster:
            raster.units = (unit,)
    notes = note_assumed_unit(path)
    assert bool(notes) == is_noted
    assert all("t.tif taken in the unit of its frame (0.3048 m)" in note for note in notes)


def test_a_projection_file_of_any_form_counts(tmp_path: Path) -> None:
    path = write(tmp_path / "t.asc", tilted(), driver="AAIGrid")
    (tmp_path / "t.prj").write_text(UTM.to_wkt())
    check_covers(read_elevation(path, UTM, BOX))
    (tmp_path / "t.prj").write_text("UTM 35")
    with pytest.raises(InputError, match="not a known CRS"):
        read_elevation(path, UTM, BOX)


def test_sparse_heights_above_the_ground_are_known(tmp_path: Path) -> None:
    heights = np.zeros((200, 200), np.float32)
    heights[95:99, 90:99] = 9.0
    assert np.isfinite(read_elevation(write(tmp_path / "t.tif", heights), UTM, BOX).heights).all()
