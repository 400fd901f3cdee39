"""Bands by what a raster states of them: roofs are (180, 60, 50), whatever the order of the bands."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyproj import CRS

from catalogs.readers.pictures.aerial import note_assumed_colours, open_orthophoto
from catalogs.readers.pictures.decoding import read_picture
from facade_core.core.errors import ImageError, InputError

rasterio = pytest.importorskip("rasterio")

FRAME = CRS.from_epsg(3879)
EAST, NORTH = 25_496_000.0, 6_672_000.0
PLACE = np.array([[EAST + 5, NORTH - 5], [EAST + 6, NORTH - 6]])
VALUES = {"red": 180, "green": 60, "blue": 50, "nir": 220, "alpha": 255, "undefined": 99, "gray": 180}


def write(path: Path, names: list[str], interpretation: list[str] | None = None, **options: Any) -> Path:
    profile = {"count": len(names), "height": 40, "width": 40, "dtype": "uint8", "crs": "EPSG:3879"}
    profile |= {"transform": rasterio.Affine(1, 0, EAST, 0, -1, NORTH)} | options
    descriptions = profile.pop("descriptions", None)
    with rasterio.open(path, "w", driver="GTiff", **profile) as raster:
        for number, name in enumerate(names, 1):
            raster.write(np.full((40, 40), VALUES[name], profile["dtype"]), number)
        if interpretation:
            raster.colorinterp = [rasterio.enums.ColorInterp[name] for name in interpretation]
        if descriptions:
            raster.descriptions = descriptions
    return path


CASES: dict[str, tuple[list[str], list[str] | None, dict[str, Any]]] = {
    "plain": (["red", "green", "blue"], None, {}),
    "BGR": (["blue", "green", "red"], ["blue", "green", "red"], {}),
    "alpha first": (["alpha", "red", "green", "blue"], ["alpha", "red", "green", "blue"], {}),
    "BGR and alpha": (["blue", "green", "red", "alpha"], ["blue", "green", "red", "alpha"], {}),
    "NIR last": (["red", "green", "blue", "nir"], ["red", "green", "blue", "undefined"], {}),
    "descriptions alone": (["nir", "red", "green", "blue"], None, {"descriptions": ["NIR", "Red", "Green", "Blue"]}),
    "descriptions of another order": (["blue", "green", "red"], None, {"descriptions": ["B", "G", "R"]}),
    "red edge": (
        ["blue", "green", "red", "undefined", "nir"],
        None,
        {"descriptions": ["band_1 blue", "band_2 green", "band_3 red", "red edge", "nir"], "photometric": "MINISBLACK"},
    ),
    "German": (["blue", "red", "green"], None, {"descriptions": ["Blau", "Rot", "Grün"]}),
}


@pytest.mark.parametrize("case", CASES.values(), ids=list(CASES))
def test_orthophotos_and_pictures_have_their_colours(tmp_path: Path, case: Any) -> None:
    names, interpretation, options = case
    path = write(tmp_path / "a.tif", names, interpretation, **options)
    photo = open_orthophoto(path, None, FRAME, PLACE)
    colour, known = photo.sample(PLACE, 0.5)
    assert known.all()
    assert colour.tolist() == [[180, 60, 50]] * 2
    assert not note_assumed_colours(photo)
    try:
        picture = read_picture(path)
    except ImageError:  # a variant of TIFF that Pillow does not open
        pass
    else:
        assert np.unique(picture.rgb.reshape(-1, 3), axis=0).tolist() == [[180, 60, 50]]
        assert not picture.hidden.any()


def test_colour_infrared_without_blue_is_refused_with_its_bands(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif", ["nir", "red", "green"], None, descriptions=["Near Infrared", "Red", "Green"])
    with pytest.raises(
        InputError, match="has the bands Near Infrared, Red, Green, and not each of red, green and blue"
    ):
        open_orthophoto(path, None, FRAME, PLACE)


def test_colour_infrared_by_interpretation_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif", ["nir", "red", "green"], ["undefined", "red", "green"])
    with pytest.raises(InputError, match="has the bands undefined, red, green, and not each of red, green and blue"):
        open_orthophoto(path, None, FRAME, PLACE)


def test_unstated_bands_are_noted(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif", ["red", "green", "blue", "nir"], None, photometric="MINISBLACK")
    [note] = note_assumed_colours(open_orthophoto(path, None, FRAME, PLACE))
    assert note.startswith("bands 1, 2 and 3 of a.tif taken for red, green and blue")


def test_hidden_pixels_of_alpha_first_are_unknown(tmp_path: Path) -> None:
    names = ["alpha", "red", "green", "blue"]
    path = write(tmp_path / "a.tif", names, names)
    with rasterio.open(path, "r+") as raster:
        raster.write(np.zeros((40, 40), np.uint8), 1)
    assert not open_orthophoto(path, None, FRAME, PLACE).sample(PLACE, 0.5)[1].any()


def test_nodata_of_colours_hides_a_pixel_whatever_the_infrared(tmp_path: Path) -> None:
    path = write(
        tmp_path / "a.tif", ["nir", "red", "green", "blue"], None, descriptions=["NIR", "R", "G", "B"], nodata=0
    )
    with rasterio.open(path, "r+") as raster:
        for band in (2, 3, 4):
            raster.write(np.zeros((40, 40), np.uint8), band)
    assert not open_orthophoto(path, None, FRAME, PLACE).sample(PLACE, 0.5)[1].any()


def test_scaled_values_of_16_bits_are_colours(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif", ["red", "green", "blue"], None, dtype="uint16", nodata=0, photometric="RGB")
    with rasterio.open(path, "r+") as raster:
        raster.write(raster.read() * 20)
        raster.scales = [0.05] * 3
        raster.write(np.zeros((3, 40, 20), np.uint16), window=rasterio.windows.Window(0, 0, 20, 40))
    picture = read_picture(path)
    assert picture.hidden[:, :20].all()
    assert picture.rgb[0, 30].tolist() == [180, 60, 50]


DEEP: dict[str, tuple[str, float, dict[str, Any], str | None]] = {
    "16 bits": ("uint16", 257, {}, None),
    "12 bits stated": ("uint16", 4095 / 255, {"nbits": 12}, None),
    "12 bits": ("uint16", 4095 / 255, {}, "taken as 4095"),
    "bytes in 16 bits": ("uint16", 1, {}, None),
    "reflectances": ("uint16", 10_000 / 255, {"scales": 1e-4}, None),
    "fractions": ("float32", 1 / 255, {}, None),
}


@pytest.mark.parametrize("case", DEEP.values(), ids=list(DEEP))
@pytest.mark.parametrize("names", [["red", "green", "blue"], ["blue", "green", "red", "nir"]])
def test_orthophotos_of_more_bits_have_their_colours(tmp_path: Path, case: Any, names: list[str]) -> None:
    kind, factor, options, words = case
    scale = options.get("scales")
    stated = {key: value for key, value in options.items() if key != "scales"}
    path = write(tmp_path / "a.tif", names, None, dtype=kind, descriptions=names, **stated)
    with rasterio.open(path, "r+") as raster:
        values = np.array([VALUES[name] * factor for name in names])[:, None, None]
        raster.write(np.broadcast_to(values, (len(names), 40, 40)).astype(kind))
        if scale:
            raster.scales = [scale] * len(names)
    photo = open_orthophoto(path, None, FRAME, PLACE)
    colour, known = photo.sample(PLACE, 0.5)
    assert known.all()
    assert np.abs(colour.astype(int) - (180, 60, 50)).max() <= 1
    notes = note_assumed_colours(photo)
    assert [words in note for note in notes] == [True] if words else not notes


def test_values_that_are_no_colours_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif", ["red", "green", "blue"], None, dtype="float32")
    with rasterio.open(path, "r+") as raster:
        raster.write(raster.read() * 1000)
    with pytest.raises(InputError, match=r"a\.tif has values from 50000 to 180000"):
        open_orthophoto(path, None, FRAME, PLACE)


def test_infrared_stated_as_opacity_hides_nothing(tmp_path: Path) -> None:
    names = ["red", "green", "blue", "nir"]
    path = write(tmp_path / "a.tif", names, ["red", "green", "blue", "alpha"])
    with rasterio.open(path, "r+") as raster:
        raster.write(np.tile(np.arange(40, dtype=np.uint8) + 5, (40, 1)), 4)
    photo = open_orthophoto(path, None, FRAME, PLACE)
    assert photo.sample(PLACE, 0.5)[1].all()
    [note] = note_assumed_colours(photo)
    assert note.startswith("band 4 of a.tif is stated as opacity but has values between")


def test_mosaics_have_the_bands_that_they_state(tmp_path: Path) -> None:
    (tmp_path / "tiles").mkdir()
    write(tmp_path / "tiles/a.tif", ["blue", "green", "red"])
    bands = "".join(
        f'<VRTRasterBand dataType="Byte" band="{n}"><ColorInterp>{name}</ColorInterp><SimpleSource><SourceFilename '
        f'relativeToVRT="1">tiles/a.tif</SourceFilename><SourceBand>{n}</SourceBand></SimpleSource></VRTRasterBand>'
        for n, name in enumerate(["Blue", "Green", "Red"], 1)
    )
    path = tmp_path / "a.vrt"
    path.write_text(
        f'<VRTDataset rasterXSize="40" rasterYSize="40"><SRS>EPSG:3879</SRS>'
        f"<GeoTransform>{EAST},1,0,{NORTH},0,-1</GeoTransform>{bands}</VRTDataset>"
    )
    photo = open_orthophoto(path, None, FRAME, PLACE)
    assert photo.sample(PLACE, 0.5)[0].tolist() == [[180, 60, 50]] * 2
    before = photo.content
    write(tmp_path / "tiles/a.tif", ["green", "green", "red"])
    assert open_orthophoto(path, None, FRAME, PLACE).content != before


def test_white_is_zero_where_it_is_stated(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif", ["undefined"], None, photometric="MINISWHITE")
    assert open_orthophoto(path, None, FRAME, PLACE).sample(PLACE, 0.5)[0].tolist() == [[156, 156, 156]] * 2
