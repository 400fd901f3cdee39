"""Heights and orthophotos that are broken, nowhere, vast, or that name other files: one line with the file and the remedy."""

from __future__ import annotations

import random
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import rasterio.shutil
from pyproj import CRS
from rasterio import Affine
from rasterio.transform import from_origin

from catalogs.block.reader import read_block
from catalogs.readers.pictures.aerial import open_orthophoto
from catalogs.readers.pictures.elevation import read_elevation
from facade_core.core.errors import InputError
from tests.faults.test_bad_inputs_pictures import changed

UTM = CRS.from_epsg(32635)
WEST, NORTH = 385_000.0, 6_672_000.0
BOX = (385_100.0, 6_671_700.0, 385_160.0, 6_671_760.0)
PLACES = np.array([BOX[:2], BOX[2:]])
HEIGHTS = np.tile(20 + np.arange(200, dtype=np.float32) / 10, (200, 1))
MOON = "IAU_2015:30110"
PLACED = from_origin(WEST, NORTH, 2, 2)


def write(folder: Path, name: str = "d.tif", values: np.ndarray = HEIGHTS, **options: Any) -> Path:
    bands = values if values.ndim == 3 else values[None]
    given = {"driver": "GTiff", "crs": "EPSG:32635", "transform": PLACED, "dtype": bands.dtype}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with rasterio.open(
            folder / name, "w", count=len(bands), height=bands.shape[1], width=bands.shape[2], **(given | options)
        ) as file:
            file.write(bands)
    return folder / name


def sparse(folder: Path, step: float, size: int, **options: Any) -> Path:
    """A raster of `size` cells a side of which none is stored."""
    given: dict[str, Any] = {"driver": "GTiff", "crs": "EPSG:32635", "dtype": "uint8", "count": 1, "SPARSE_OK": "TRUE"}
    given |= {
        "tiled": True,
        "blockxsize": 8192,
        "blockysize": 8192,
        "compress": "deflate",
        "transform": from_origin(BOX[0] - 300, BOX[3] + 300, step, step),
    }
    with rasterio.open(folder / "d.tif", "w", width=size, height=size, BIGTIFF="YES", **(given | options)):
        pass
    return folder / "d.tif"


def content(data: bytes, name: str = "d.tif") -> Callable[[Path], Path]:
    def written(folder: Path) -> Path:
        (folder / name).write_bytes(data)
        return folder / name

    return written


def cells(*transform: float) -> Callable[[Path], Path]:
    """A GeoTIFF of such cells; as tags, for GDAL writes some of them as no place at all."""

    def written(folder: Path) -> Path:
        path = write(folder)
        data = path.read_bytes()
        scale = np.array([2.0, 2.0, 0.0]).tobytes()
        assert scale in data
        path.write_bytes(data.replace(scale, np.array(transform, np.float64).tobytes()))
        return path

    return written


def vrt(inner: str, name: str = "d.vrt", attributes: str = "") -> Callable[[Path], Path]:
    def written(folder: Path) -> Path:
        write(folder, "tile.tif")
        (folder / name).write_text(
            f'<VRTDataset rasterXSize="200" rasterYSize="200"><SRS>EPSG:32635</SRS>'
            f"<GeoTransform>{WEST}, 2, 0, {NORTH}, 0, -2</GeoTransform>"
            f'<VRTRasterBand dataType="Float32" band="1"{attributes}>{inner}</VRTRasterBand></VRTDataset>'
        )
        return folder / name

    return written


def source(text: str, relative: int = 1, kind: str = "SimpleSource", more: str = "") -> str:
    rectangle = 'xOff="0" yOff="0" xSize="200" ySize="200"'
    return (
        f'<{kind}><SourceFilename relativeToVRT="{relative}">{text}</SourceFilename>{more}<SourceBand>1</SourceBand>'
        f"<SrcRect {rectangle}/><DstRect {rectangle}/></{kind}>"
    )


RAW = "<SourceFilename relativetoVRT='0'>/etc/hostname</SourceFilename><PixelOffset>1</PixelOffset>"
OVERVIEWS = b"<PAMDataset><Metadata><MDI key='OVERVIEW_FILE'>/etc/x</MDI></Metadata></PAMDataset>"
NO_AREA = r"has cells without an area or beyond the Earth \(.*\); export it again with its place"
HERE = r"is put together from .*, which (is no file here|lies outside its folder); give one GeoTIFF"
MORE = r"is more than a mosaic of files \(.*\); give one GeoTIFF"
NO_RASTER = r"cannot be read as a raster"
DEM: dict[str, tuple[Callable[[Path], Path], str]] = {
    "zero-cells": (cells(0, 0, 0), r"states control points only; warp it with gdalwarp"),
    "cells-without-width": (cells(0, 2, 0), r"states control points only; warp it with gdalwarp"),
    "cells-without-area": (lambda f: write(f, transform=Affine(0, 0, WEST, 0, 0, NORTH)), NO_AREA),
    "cells-no-number": (cells(np.nan, 2, 0), NO_AREA),
    "cells-infinite": (cells(np.inf, np.inf, 0), NO_AREA),
    "cells-1e300": (cells(1e300, 1e300, 0), NO_AREA),
    "cells-1e-300": (cells(1e-300, 1e-300, 0), NO_AREA),
    "cells-of-a-nanometre": (cells(1e-8, 1e-8, 0), r"does not cover the block|has cells of"),
    "degenerate": (lambda f: write(f, transform=Affine(2, 2, WEST, 2, 2, NORTH)), NO_AREA),
    "no-place": (lambda f: write(f, transform=Affine.identity()), r"states no place on the ground; put its world file"),
    "no-frame": (lambda f: write(f, crs=None), r"states no frame; put its \.prj beside it"),
    "local-frame": (
        lambda f: write(f, crs='LOCAL_CS["x",UNIT["metre",1]]'),
        r"d\.tif(: .*no places on a map| states no)",
    ),
    "lunar-frame": (
        lambda f: write(f, crs=MOON),
        r"not a frame of the Earth|no places on a map|is not a known CRS",
    ),
    "south-and-west": (lambda f: write(f, crs="EPSG:2065"), r"axes are not east and north; warp it|does not cover"),
    "another-place": (lambda f: write(f, transform=from_origin(0, 0, 2, 2)), r"does not cover the block"),
    "beyond-the-earth": (lambda f: write(f, transform=from_origin(1e15, 1e15, 2, 2)), r"does not cover the block"),
    "nothing-known": (lambda f: write(f, values=HEIGHTS * np.nan), r"has no known height inside the block"),
    "infinite": (lambda f: write(f, values=HEIGHTS + np.inf), r"has no known height inside the block"),
    "out-of-space": (lambda f: write(f, values=HEIGHTS + 1e6), r"has no known height inside the block"),
    "marked-as-unknown": (lambda f: write(f, values=HEIGHTS * 0 - 9, nodata=-9.0), r"has no known height inside"),
    "complex": (lambda f: write(f, values=HEIGHTS.astype(np.complex64)), r"has complex numbers for heights"),
    "millimetres": (
        lambda f: sparse(f, 0.001, 700_000),
        r"has 6\d+ x 6\d+ cells of 0.001 m around the block; resample",
    ),
    "tenths-of-millimetres": (lambda f: sparse(f, 0.0002, 2_000_000), r"resample it"),
    "one-vast-block": (
        lambda f: sparse(f, 0.05, 30_000, blockxsize=24_576, blockysize=24_576),
        r"is stored in blocks of 24576 x 24576 cells; rewrite it",
    ),
    "vrt-raw": (vrt(RAW, attributes=' subClass="VRTRawRasterBand"'), MORE),
    "vrt-raw-in-small": (vrt(RAW, attributes=' subclass="vrtrawrasterband"'), MORE),
    "vrt-offset": (vrt(RAW), HERE),
    "vrt-derived": (vrt("<PixelFunctionType>x</PixelFunctionType>" + source("tile.tif")), MORE),
    "vrt-kernel": (vrt(source("tile.tif", kind="KernelFilteredSource")), MORE),
    "vrt-options": (vrt(source("tile.tif", more="<OpenOptions><OOI key='A'>b</OOI></OpenOptions>")), MORE),
    "vrt-overview": (vrt(source("tile.tif") + "<Overview/>"), MORE),
    "vrt-mask": (vrt(source("tile.tif") + "<MaskBand/>"), MORE),
    "vrt-small-letters": (vrt(source("tile.tif").replace("SourceFilename", "sourcefilename")), MORE),
    "vrt-overview-file": (vrt("<Metadata><MDI key='OVERVIEW_FILE'>/x</MDI></Metadata>" + source("tile.tif")), MORE),
    "vrt-address": (vrt(source("/vsicurl/http://127.0.0.1:9/a.tif", 0)), HERE),
    "vrt-zip": (vrt(source("/vsizip/tile.zip/a.tif", 0)), HERE),
    "vrt-web": (vrt(source("http://127.0.0.1:9/a.tif", 0)), HERE),
    "vrt-above": (vrt(source("../d.tif")), HERE),
    "vrt-etc": (vrt(source("/etc/hostname", 0)), HERE),
    "vrt-proc": (vrt(source("/proc/self/mem", 0)), HERE),
    "vrt-nul": (vrt(source("a&#0;b")), r"is no raster, nor XML of one"),
    "vrt-text": (
        lambda f: vrt(source("t.tif"))(content(b"secret", "t.tif")(f).parent),
        r"t\.tif cannot be read as a raster \(it is none of",
    ),
    "vrt-of-itself": (vrt(source("d.vrt")), r"is a virtual raster of virtual rasters 5 times over"),
    "vrt-laughs": (
        content(b'<!DOCTYPE a [<!ENTITY b "c"><!ENTITY d "&b;&b;">]><VRTDataset>&d;</VRTDataset>', "d.vrt"),
        r"is no raster, nor XML of one",
    ),
    "vrt-deep": (content(b"<VRTDataset>" + b"<SRS>" * 100_000, "d.vrt"), r"is no raster, nor XML of one"),
    "vrt-huge": (content(b"<VRTDataset>" + b" " * 5_000_000, "d.vrt"), r"is XML of more than 4 MB"),
    "wms": (content(b"<GDAL_WMS><Service name='TMS'/></GDAL_WMS>"), r"is XML \(GDAL_WMS\), no raster"),
    "json": (content(b'{"type": "STACIT"}'), r"is JSON, no raster"),
    "text": (content(b"no heights"), NO_RASTER),
    "empty": (content(b""), NO_RASTER),
    "zeros": (content(bytes(5000)), NO_RASTER),
    "netcdf": (content(b"CDF\1" + bytes(100)), r"it is none of AAIGrid, DTED, GTiff"),
    "eps": (content(b"%!PS-Adobe-3.0 EPSF-3.0\n"), NO_RASTER),
    "grid-without-numbers": (
        content(b"ncols 20\nnrows 20\nxllcorner 0\nyllcorner 0\ncellsize 0\n1 2 3", "d.asc"),
        r"d\.asc ",
    ),
    "grid-of-10^9": (
        content(b"ncols 999999999\nnrows 999999999\nxllcorner 0\nyllcorner 0\ncellsize 1", "d.asc"),
        r"d\.asc ",
    ),
    "only-a-signature": (content(b"II*\0"), NO_RASTER),
    "cut": (lambda f: content(write(f).read_bytes()[:60_000])(f), r"has damaged cells around"),
    "folder": (lambda f: f, r"is no file; give an elevation raster"),
    "missing": (lambda f: f / "none.tif", r"is no file; give an elevation raster"),
    "overviews-elsewhere": (
        lambda f: content(
            b"<PAMDataset><Metadata><MDI key='OVERVIEW_FILE'>/etc/x</MDI></Metadata></PAMDataset>", "d.tif.aux.xml"
        )(write(f).parent).with_name("d.tif"),
        r"d\.tif\.aux\.xml names another file for overviews; remove it",
    ),
}


@pytest.mark.parametrize("case", DEM)
def test_heights_that_are_none_are_refused_in_one_line(case: str, tmp_path: Path) -> None:
    made, expected = DEM[case]
    with pytest.raises(InputError, match=expected) as raised:
        read_elevation(made(tmp_path), UTM, BOX)
    said = str(raised.value)
    assert said.isprintable()
    assert said.startswith(str(tmp_path))


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("value", [1e308, -1e308, 1e39])
def test_heights_beyond_all_numbers_are_refused_without_a_warning(value: float, tmp_path: Path) -> None:
    path = write(tmp_path, values=np.full(HEIGHTS.shape, value))
    with pytest.raises(InputError, match="has no known height inside"):
        read_elevation(path, UTM, BOX)


@pytest.mark.parametrize("name", ["d.tif", "d.asc", "d.img", "d.vrt", "coarse.tif", "turned.tif"])
def test_heights_as_they_are_wanted_are_read(name: str, tmp_path: Path) -> None:
    path = write(tmp_path)
    if name == "d.vrt":
        path = vrt(source("tile.tif"))(tmp_path)
    elif name == "coarse.tif":
        path = write(tmp_path, name, HEIGHTS[:4, :4], transform=from_origin(WEST - 8000, NORTH + 8000, 5000, 5000))
    elif name == "turned.tif":
        path = write(
            tmp_path,
            name,
            transform=PLACED @ Affine.translation(100, 100) @ Affine.rotation(30) @ Affine.translation(-100, -100),
        )
    elif name != "d.tif":
        driver = {"d.asc": "AAIGrid", "d.img": "HFA"}[name]
        rasterio.shutil.copy(str(path), str(tmp_path / name), driver=driver)
        path = tmp_path / name
    heights = read_elevation(path, UTM, BOX).heights
    assert np.isfinite(heights).mean() > 0.4, "and a margin around the block"
    assert 19 < np.nanmin(heights) < np.nanmax(heights) < 41


COLOURS = np.stack([np.full((200, 200), value, np.uint8) for value in (200, 120, 40)])


def ortho(folder: Path, **options: Any) -> Path:
    return write(folder, "o.tif", options.pop("values", COLOURS), **options)


ORTHO: dict[str, tuple[Callable[[Path], Path], str]] = {
    "zero-cells": (lambda f: ortho(f, transform=Affine(0, 0, WEST, 0, 0, NORTH)), NO_AREA),
    "degenerate": (lambda f: ortho(f, transform=Affine(2, 2, WEST, 2, 2, NORTH)), NO_AREA),
    "no-place": (lambda f: ortho(f, transform=Affine.identity()), r"states no place on the ground"),
    "no-frame": (lambda f: ortho(f, crs=None), r"states no frame; write imagery.aerial.crs"),
    "lunar": (lambda f: ortho(f, crs=MOON), r"not a frame of the Earth|no places on a map|is not a known CRS"),
    "heights": (
        lambda f: ortho(f, values=COLOURS * np.float32(9)),
        r"has values from 360 to 1800 .*, which are neither",
    ),
    "complex": (lambda f: ortho(f, values=COLOURS.astype(np.complex64)), r"has complex values"),
    "elsewhere": (lambda f: ortho(f, transform=from_origin(0, 0, 2, 2)), r"o\.tif "),
    "one-vast-block": (
        lambda f: sparse(f, 0.05, 30_000, blockxsize=24_576, blockysize=24_576),
        r"is stored in blocks of 24576 x 24576 cells; rewrite it",
    ),
    "vrt": (vrt(source("tile.tif"), "o.tif"), r"o\.tif is no orthophoto; give a GeoTIFF"),
    "gif": (content(b"GIF89a" + bytes(99), "o.tif"), r"is no orthophoto"),
    "empty": (content(b"", "o.tif"), r"is no orthophoto"),
    "jpeg-start": (content(b"\xff\xd8\xff\xe0" + bytes(99), "o.jpg"), r"cannot be read as an orthophoto"),
    "cut": (lambda f: content(ortho(f).read_bytes()[:30_000], "o.tif")(f), r"cannot be read as an orthophoto"),
}


@pytest.mark.parametrize("case", ORTHO)
def test_an_orthophoto_that_is_none_is_refused_in_one_line(case: str, tmp_path: Path) -> None:
    made, expected = ORTHO[case]
    with pytest.raises(InputError, match=expected) as raised:
        open_orthophoto(made(tmp_path), None, UTM, PLACES)
    assert str(raised.value).isprintable()


def test_an_orthophoto_of_millimetres_is_not_read_for_minutes(tmp_path: Path) -> None:
    found = open_orthophoto(sparse(tmp_path, 0.001, 700_000), None, UTM, PLACES)
    with pytest.raises(InputError, match=r"pixels where one surface lies; resample it to 1 cm, or coarser"):
        found.sample(PLACES, 0.05)


@pytest.mark.parametrize("seed", ["d.tif", "deflate.tif", "d.asc", "d.img", "d.vrt", "ortho"])
def test_changed_bytes_of_a_raster_are_read_or_refused(seed: str, tmp_path: Path) -> None:
    path = write(tmp_path)
    if seed == "deflate.tif":
        path = write(tmp_path, seed, compress="deflate", tiled=True, blockxsize=64, blockysize=64)
    elif seed == "d.vrt":
        path = vrt(source("tile.tif"))(tmp_path)
    elif seed == "ortho":
        path = ortho(tmp_path, compress="lzw")
    elif seed != "d.tif":
        rasterio.shutil.copy(str(path), str(tmp_path / seed), driver={"d.asc": "AAIGrid", "d.img": "HFA"}[seed])
        path = tmp_path / seed
    whole, chance, refused = path.read_bytes(), random.Random(seed), []
    for _ in range(60):
        path.write_bytes(changed(whole, chance))
        try:
            if seed == "ortho":
                open_orthophoto(path, None, UTM, PLACES).sample(PLACES, 0.5)
            else:
                read_elevation(path, UTM, BOX)
        except InputError as error:
            refused.append(str(error))
    assert len(refused) > 10
    assert all(said.isprintable() for said in refused)


@pytest.mark.parametrize("case", ["key-dem-vrt-raw", "key-dem-zero-cell", "key-ort-degenerate", "key-ort-zero-cell"])
def test_cases_of_before(case: str, data: Path) -> None:
    if not (data / "bad_inputs" / case).is_dir():
        pytest.skip("no bad inputs in the data folder")
    with pytest.raises(InputError, match=rf"(terrain|imagery\.aerial)\.path: .*{case}/[do]\.(tif|vrt) (is|has) "):
        read_block(data / "bad_inputs" / case / "block.yaml")
