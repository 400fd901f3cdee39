"""Orthophotos: colours come from where they are, whatever the frame, the turn and the resolution."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pyproj import CRS, Transformer

from catalogs.readers.pictures.aerial import open_orthophoto
from facade_core.core.errors import InputError

rasterio = pytest.importorskip("rasterio")

FRAME = CRS.from_epsg(3879)
EAST, NORTH = 25_496_000.0, 6_672_000.0
PLACES = np.array([[EAST + 5, NORTH + 5], [EAST + 20, NORTH + 12]])


def chessboard(rows: int, columns: int, square: int) -> np.ndarray:
    """(3, rows, columns): every square of pixels in a colour of its own."""
    row, column = np.mgrid[:rows, :columns] // square
    return np.stack([20 + 5 * column, 20 + 5 * row, 40 + 0 * row]).astype(np.uint8)


def write(path: Path, image: np.ndarray, transform, crs: str | None = "EPSG:3879", **options) -> Path:
    profile = {"count": len(image), "height": image.shape[1], "width": image.shape[2], "dtype": image.dtype.name}
    if transform is not None:
        profile["transform"] = transform
    with rasterio.open(path, "w", crs=crs, driver="GTiff", **profile, **options) as raster:
        raster.write(image)
    return path


def north_up(pixel: float = 0.1):
    return rasterio.Affine(pixel, 0, EAST, 0, -pixel, NORTH + 40)


def test_colours_lie_where_they_are_to_the_centimetre(tmp_path: Path) -> None:
    """Pixels of 10 cm in squares of 1 m: 6 cm from a square's border its colour is pure, on the border both are halved."""
    path = write(tmp_path / "a.tif", chessboard(400, 400, 10), north_up(), tiled=True, blockxsize=64, blockysize=64)
    aerial = open_orthophoto(path, None, FRAME, PLACES)
    x, y = np.meshgrid(np.arange(3, 25), np.arange(3, 25))
    for dx, dy in ((0.06, 0.06), (0.94, 0.5), (0.5, 0.94)):
        points = np.column_stack([EAST + x.ravel() + dx, NORTH + y.ravel() + dy])
        colour, known = aerial.sample(points, 0.05)
        assert known.all()
        np.testing.assert_array_equal(colour[:, 0], 20 + 5 * x.ravel())
        np.testing.assert_array_equal(colour[:, 1], 20 + 5 * (39 - y.ravel()))
    border, _ = aerial.sample(np.array([[EAST + 7.0, NORTH + 7.5], [EAST + 7.01, NORTH + 7.5]]), 0.05)
    assert border[:, 0].tolist() == [pytest.approx(20 + 5 * 6.5, abs=0.6), pytest.approx(20 + 5 * 6.6, abs=0.6)]


def test_a_partial_and_a_transparent_tile_say_what_they_do_not_know(tmp_path: Path) -> None:
    image = np.concatenate([chessboard(400, 400, 10), np.full((1, 400, 400), 255, np.uint8)])
    image[3, :, 200:] = 0
    path = write(tmp_path / "a.tif", image, north_up(), photometric="RGB", alpha="yes")
    aerial = open_orthophoto(path, None, FRAME, PLACES)
    points = np.array(
        [[EAST + 19.9, NORTH + 5.5], [EAST + 20.1, NORTH + 5.5], [EAST - 0.1, NORTH + 5], [EAST + 1, NORTH + 0.01]]
    )
    colour, known = aerial.sample(points, 0.05)
    assert known.tolist() == [True, False, False, True]
    assert colour[0].tolist() == [20 + 5 * 19, 20 + 5 * 34, 40]
    assert aerial.sample(points + 1000.0, 0.05)[1].tolist() == [False] * 4


def test_a_turned_world_file_beside_a_picture(tmp_path: Path) -> None:
    from PIL import Image

    path = tmp_path / "a.png"
    Image.fromarray(np.moveaxis(chessboard(200, 300, 20), 0, -1)).save(path)
    turn, pixel = np.radians(30), 0.1
    a, d, b, e = pixel * np.cos(turn), pixel * np.sin(turn), pixel * np.sin(turn), -pixel * np.cos(turn)
    (tmp_path / "a.pgw").write_text("\n".join(map(str, (a, d, b, e, EAST + (a + b) / 2, NORTH + (d + e) / 2))))
    with pytest.raises(InputError, match=r"a\.png states no frame; write imagery\.aerial\.crs"):
        open_orthophoto(path, None, FRAME, PLACES)
    aerial = open_orthophoto(path, "EPSG:3879", FRAME, np.array([[EAST + 10, NORTH]]))
    column, row = np.meshgrid(np.arange(15) * 20 + 3.0, np.arange(10) * 20 + 17.0)
    points = np.column_stack(
        [EAST + a * column.ravel() + b * row.ravel(), NORTH + d * column.ravel() + e * row.ravel()]
    )
    colour, known = aerial.sample(points, 0.05)
    assert known.all()
    np.testing.assert_array_equal(colour[:, 0], 20 + 5 * (column.ravel() // 20))
    np.testing.assert_array_equal(colour[:, 1], 20 + 5 * (row.ravel() // 20))


def test_a_tile_in_another_frame(tmp_path: Path) -> None:
    """In degrees: colours are found at the places that the frames agree on."""
    to_degrees = Transformer.from_crs(FRAME, "EPSG:4326", always_xy=True)
    west, south = to_degrees.transform(EAST - 10, NORTH - 10)
    step = 1e-6
    path = write(
        tmp_path / "a.tif",
        chessboard(800, 1200, 60),
        rasterio.Affine(step, 0, west, 0, -step, south + 800 * step),
        "EPSG:4326",
    )
    aerial = open_orthophoto(path, None, FRAME, PLACES)
    longitude = west + step * (np.arange(20) * 60 + 30)
    latitude = south + 800 * step - step * np.linspace(90, 690, 20).round(-1)
    points = np.column_stack(to_degrees.transform(longitude, latitude, direction="INVERSE"))
    colour, known = aerial.sample(points, 0.05)
    assert known.all()
    np.testing.assert_array_equal(colour[:, 0], 20 + 5 * np.arange(20))


def test_fine_pixels_are_averaged_at_a_coarse_spacing(tmp_path: Path) -> None:
    """One pixel black, the next white, 5 cm each: at half a metre they are grey, and nothing moves."""
    image = np.zeros((3, 800, 800), np.uint8)
    image[:, ::2, ::2] = image[:, 1::2, 1::2] = 255
    image[0, :, 400:] = 255
    aerial = open_orthophoto(write(tmp_path / "a.tif", image, north_up(0.05)), None, FRAME, PLACES)
    x = EAST + np.arange(0.75, 39, 0.5)
    colour, known = aerial.sample(np.column_stack([x, np.full(len(x), NORTH + 20.25)]), 0.5)
    assert known.all()
    assert np.abs(colour[:, 1].astype(int) - 127).max() <= 2
    assert (colour[x < EAST + 19.5, 0] < 130).all()
    assert (colour[x > EAST + 20.5, 0] == 255).all()


def test_grey_and_palette_pictures(tmp_path: Path) -> None:
    grey = open_orthophoto(
        write(tmp_path / "g.tif", np.full((1, 400, 400), 77, np.uint8), north_up()), None, FRAME, PLACES
    )
    assert grey.sample(PLACES, 0.1)[0].tolist() == [[77] * 3] * 2
    path = tmp_path / "p.tif"
    write(path, np.full((1, 400, 400), 5, np.uint8), north_up(), photometric="palette")
    with rasterio.open(path, "r+") as raster:
        raster.write_colormap(1, {5: (10, 200, 30, 255)})
    assert open_orthophoto(path, None, FRAME, PLACES).sample(PLACES, 0.1)[0].tolist() == [[10, 200, 30]] * 2


def test_what_cannot_be_used_is_refused_in_one_line(tmp_path: Path) -> None:
    image = chessboard(400, 400, 10)
    cases = {
        "states no place on the ground; give a GeoTIFF": write(tmp_path / "nowhere.tif", image, None),
        "states no frame": write(tmp_path / "frameless.tif", image, north_up(), None),
        "which are neither 0 to 1 nor 0 to 255": write(tmp_path / "deep.tif", image * np.float32(9), north_up()),
        "shows nothing of the block": write(
            tmp_path / "far.tif", image, rasterio.Affine(0.1, 0, EAST + 9000, 0, -0.1, NORTH)
        ),
    }
    cut = write(tmp_path / "cut.tif", np.random.default_rng(0).integers(0, 255, (3, 400, 400), np.uint8), north_up())
    cut.write_bytes(cut.read_bytes()[:250_000])
    text = tmp_path / "text.tif"
    text.write_text("no picture")
    vrt = tmp_path / "linked.tif"
    vrt.write_text('<VRTDataset rasterXSize="1" rasterYSize="1"><SRS>EPSG:3879</SRS></VRTDataset>')
    cases |= {"cut.tif cannot be read": cut, "text.tif is no orthophoto": text, "linked.tif is no orthophoto": vrt}
    for message, path in cases.items():
        with pytest.raises(InputError, match=message) as caught:
            open_orthophoto(path, None, FRAME, PLACES)
        assert "\n" not in str(caught.value), message
        assert path.name in str(caught.value), message
