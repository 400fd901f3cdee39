"""Pictures of every kind that are no plain 8-bit RGB: shown as they are meant, or refused in one line; never black, never more
memory than their pixels explain."""

from __future__ import annotations

import io
import os
import random
import subprocess
import sys
import warnings
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from PIL import Image, ImageOps

from catalogs.readers.pictures import decoding as pictures
from catalogs.readers.pictures.decoding import open_picture, read_picture
from catalogs.readers.pictures.folders import check_picture, list_images, photos_by_facade
from catalogs.readers.settings import PICTURES
from facade_core.core.errors import ImageError, InputError
from tasks.stages.facades.photos import read_facade_photo
from tasks.stages.shared.images import (
    MAX_EXEMPLAR_SIDE,
    read_exemplar_picture,
    read_image_and_mask,
)
from tasks.stages.shared.images import MAX_PIXELS as KEPT

RAMP = np.linspace(0.0, 1.0, 48 * 64).reshape(48, 64)
COLOUR = np.stack([RAMP, RAMP / 2, 1 - RAMP], axis=-1)
RGB = np.rint(COLOUR * 255).astype(np.uint8)
SEEN = RAMP > 0.5


def saved(folder: Path, name: str, image: Image.Image, **options: Any) -> Path:
    image.save(folder / name, **options)
    return folder / name


def raster(folder: Path, name: str, values: np.ndarray, driver: str = "GTiff", **options: Any) -> Path:
    """A picture of any kind of number, (h, w) or (h, w, bands)."""
    bands = np.atleast_3d(values)
    shape = {"count": bands.shape[2], "height": bands.shape[0], "width": bands.shape[1], "dtype": bands.dtype}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with rasterio.open(folder / name, "w", driver=driver, **(shape | options)) as file:
            file.write(np.moveaxis(bands, -1, 0))
    return folder / name


def deep(
    most: float, kind: Any, name: str = "a.tif", values: np.ndarray = RAMP, **options: Any
) -> Callable[[Path], Path]:
    return lambda folder: raster(folder, name, (values * most).astype(kind), **options)


def plain(mode: str, name: str = "a.png", **options: Any) -> Callable[[Path], Path]:
    return lambda folder: saved(folder, name, Image.fromarray(RGB).convert(mode), **options)


def palette(name: str, **options: Any) -> Callable[[Path], Path]:
    return lambda folder: saved(folder, name, Image.fromarray(RGB).quantize(200), **options)


def with_alpha(values: np.ndarray, most: float, kind: Any) -> np.ndarray:
    return np.dstack([values * most, np.where(SEEN, np.iinfo(kind).max, 0)]).astype(kind)


GREY, U16 = np.repeat(RAMP[..., None], 3, axis=-1), np.uint16
RGB16 = {"photometric": "RGB"}
ANIMATED = {"save_all": True, "append_images": [Image.new("RGB", (64, 48), "red")]}
# How the picture is written -> what it shows, 0 to 1, and what of it is hidden.
SHOWN: dict[str, tuple[Callable[[Path], Path], np.ndarray, np.ndarray | None]] = {
    "rgb": (plain("RGB"), COLOUR, None),
    "grey": (
        plain("L"),
        RGB.mean(axis=2)[..., None] * 0 + np.asarray(Image.fromarray(RGB).convert("L"))[..., None] / 255,
        None,
    ),
    "palette": (palette("a.png"), COLOUR, None),
    "palette-gif": (palette("a.gif"), COLOUR, None),
    "cmyk-jpeg": (plain("CMYK", "a.jpg", quality=95), COLOUR, None),
    "cmyk-tiff": (plain("CMYK", "a.tif"), COLOUR, None),
    "ycbcr-tiff": (plain("YCbCr", "a.tif"), COLOUR, None),
    "lab-tiff": (plain("LAB", "a.tif"), COLOUR, None),
    "bmp": (plain("RGB", "a.bmp"), COLOUR, None),
    "webp": (plain("RGB", "a.webp", lossless=True), COLOUR, None),
    "lzw": (plain("RGB", "a.tif", compression="tiff_lzw"), COLOUR, None),
    "jpeg-in-tiff": (plain("RGB", "a.tif", compression="jpeg", quality=95), COLOUR, None),
    "progressive": (plain("RGB", "a.jpg", progressive=True, quality=95), COLOUR, None),
    "another-suffix": (plain("RGB", "a.png", format="JPEG", quality=95), COLOUR, None),
    "animated-png": (plain("RGB", "a.png", **ANIMATED), COLOUR, None),
    "animated-webp": (plain("RGB", "a.webp", lossless=True, **ANIMATED), COLOUR, None),
    "animated-gif": (
        lambda folder: saved(folder, "a.gif", Image.fromarray(RGB).quantize(200), **ANIMATED),
        COLOUR,
        None,
    ),
    "pages": (plain("RGB", "a.tif", **ANIMATED), COLOUR, None),
    "mpo": (plain("RGB", "a.jpg", format="MPO", quality=95, **ANIMATED), COLOUR, None),
    "separate-bands": (deep(255, np.uint8, values=COLOUR, interleave="band", **RGB16), COLOUR, None),
    "16-bit-grey-png": (deep(65535, U16, "a.png", driver="PNG"), GREY, None),
    "16-bit-grey-tiff": (deep(65535, U16), GREY, None),
    "16-bit-rgb-png": (deep(65535, U16, "a.png", COLOUR, driver="PNG"), COLOUR, None),
    "16-bit-rgb-tiff": (deep(65535, U16, values=COLOUR, **RGB16), COLOUR, None),
    "16-bit-separate": (deep(65535, U16, values=COLOUR, interleave="band", **RGB16), COLOUR, None),
    "16-bit-big-endian": (deep(65535, U16, values=COLOUR, ENDIANNESS="BIG", **RGB16), COLOUR, None),
    "14-in-16": (deep(2**14 - 1, U16), GREY, None),
    "12-in-16-grey-png": (deep(4095, U16, "a.png", driver="PNG"), GREY, None),
    "12-in-16-rgb-png": (deep(4095, U16, "a.png", COLOUR, driver="PNG"), COLOUR, None),
    "12-in-16-rgb-tiff": (deep(4095, U16, values=COLOUR, **RGB16), COLOUR, None),
    "12-bits": (deep(4095, U16, nbits=12), GREY, None),
    "10-in-16": (deep(1023, U16), GREY, None),
    "8-in-16": (deep(255, U16), GREY, None),
    "white-is-zero": (deep(65535, U16, photometric="MINISWHITE"), 1 - GREY, None),
    "signed-16": (deep(2**15 - 1, np.int16), GREY / 2, None),
    "signed-8": (deep(127, np.int8), GREY / 2, None),
    "32-bit": (deep(255, np.int32), GREY, None),
    "32-bit-unsigned": (deep(65535, np.uint32), GREY, None),
    "float-to-1": (deep(1, np.float32), GREY, None),
    "float-to-255": (deep(255, np.float32), GREY, None),
    "float-lzw": (deep(1, np.float32, compress="lzw", predictor=3), GREY, None),
    "all-black-16": (deep(0, U16), GREY * 0, None),
    "alpha": (lambda folder: saved(folder, "a.png", Image.fromarray(with_alpha(COLOUR, 255, np.uint8))), COLOUR, ~SEEN),
    "alpha-webp": (
        lambda folder: saved(
            folder, "a.webp", Image.fromarray(with_alpha(COLOUR, 255, np.uint8)), lossless=True, exact=True
        ),
        COLOUR,
        ~SEEN,
    ),
    "grey-alpha": (
        lambda folder: saved(folder, "a.png", Image.fromarray(with_alpha(COLOUR, 255, np.uint8)).convert("LA")),
        np.asarray(Image.fromarray(RGB).convert("L"))[..., None] / 255,
        ~SEEN,
    ),
    "alpha-16": (lambda folder: raster(folder, "a.png", with_alpha(COLOUR, 4095, U16), "PNG"), COLOUR, ~SEEN),
    "alpha-16-tiff": (
        lambda folder: raster(folder, "a.tif", with_alpha(COLOUR, 65535, U16), photometric="RGB", alpha="yes"),
        COLOUR,
        ~SEEN,
    ),
    "grey-alpha-16": (lambda folder: raster(folder, "a.png", with_alpha(RAMP, 65535, U16), "PNG"), GREY, ~SEEN),
    "no-number": (
        lambda folder: raster(folder, "a.tif", np.where(SEEN, RAMP, np.nan).astype(np.float32)),
        GREY,
        ~SEEN,
    ),
    "no-data": (
        lambda folder: raster(folder, "a.tif", np.where(SEEN, RAMP, -9999).astype(np.float32), nodata=-9999),
        GREY,
        ~SEEN,
    ),
    "infinite": (lambda folder: raster(folder, "a.tif", np.where(SEEN, RAMP, np.inf).astype(np.float32)), GREY, ~SEEN),
}


@pytest.mark.parametrize("case", SHOWN)
def test_a_picture_is_shown_as_it_is_meant(case: str, tmp_path: Path) -> None:
    write, colour, hidden = SHOWN[case]
    found = read_picture(write(tmp_path))
    expected_hidden = np.zeros(RAMP.shape, bool) if hidden is None else hidden
    assert (found.hidden == expected_hidden).all()
    missed = np.abs(found.rgb / 255 - colour)[~expected_hidden]
    assert missed.mean() < 0.02, "jpeg and palettes are not exact"
    assert missed.max() < 0.12
    assert found.scale == 1


@pytest.mark.parametrize("transparency", [3, b"\xff\x00\x00" + b"\xff" * 253])
def test_what_a_palette_or_key_makes_transparent_is_hidden(transparency: Any, tmp_path: Path) -> None:
    image = Image.fromarray(RGB).quantize(16)
    hidden = read_picture(saved(tmp_path, "a.png", image, transparency=transparency)).hidden
    indices = [3] if isinstance(transparency, int) else [1, 2]
    assert (hidden == np.isin(np.asarray(image), indices)).all()
    keyed = saved(tmp_path, "b.png", Image.fromarray(RGB), transparency=tuple(RGB[5, 5].tolist()))
    assert (read_picture(keyed).hidden == (RGB[5, 5] == RGB).all(axis=2)).all()


def bytes_of(layout: str, image: Image.Image | None = None, **options: Any) -> bytes:
    stream = io.BytesIO()
    (image or Image.fromarray(RGB)).save(stream, layout, **options)
    return stream.getvalue()


def as_png(content: bytes) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        (folder / "a.png").write_bytes(content)
        return folder / "a.png"

    return write


def claimed(width: int, height: int, depth: int = 8, kind: int = 2) -> bytes:
    """A PNG of which the header claims a size and the rest holds next to nothing."""

    def chunk(name: bytes, data: bytes) -> bytes:
        return len(data).to_bytes(4, "big") + name + data + zlib.crc32(name + data).to_bytes(4, "big")

    header = width.to_bytes(4, "big") + height.to_bytes(4, "big") + bytes([depth, kind, 0, 0, 0])
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(bytes(999))) + chunk(b"IEND", b"")
    )


NEITHER = r"which are neither 0 to \d+ nor 0 to \d+; save it as PNG or JPEG of 8 bits"
NONE_OF = r"a\.\w+ cannot be opened as a picture: it is none of PNG, JPEG, TIFF, WEBP, BMP, GIF"
REFUSED: dict[str, tuple[Callable[[Path], Path], str]] = {
    "float-65535": (deep(65535, np.float32), rf"a\.tif has values from 0 to 65535 \(float32\), {NEITHER}"),
    "float-1.5": (deep(1.5, np.float32), rf"values from 0 to 1.5 \(float32\), {NEITHER}"),
    "float-0.01": (deep(0.01, np.float32), rf"values from 0 to 0.01 \(float32\), {NEITHER}"),
    "float-1e30": (deep(1e30, np.float32), rf"values from 0 to 1e\+30 \(float32\), {NEITHER}"),
    "float-negative": (deep(-1, np.float32), rf"values from -1 to -?0 \(float32\), {NEITHER}"),
    "signed-negative": (deep(-500, np.int16), rf"values from -500 to 0 \(int16\), {NEITHER}"),
    "signed-8-negative": (deep(-100, np.int8), rf"values from -100 to 0 \(int8\), {NEITHER}"),
    "32-bit-full": (deep(4e9, np.uint32), rf"values from 0 to 4e\+09 \(uint32\), {NEITHER}"),
    "mask-in-16": (deep(3, U16), rf"values from 0 to 3 \(uint16\), {NEITHER}"),
    "all-no-number": (deep(np.nan, np.float32), r"a\.tif has no pixel that is a number; replace or remove it"),
    "float-rgb": (deep(1, np.float32, values=COLOUR, **RGB16), NONE_OF),
    "float-64": (deep(1, np.float64), NONE_OF),
    "complex": (deep(1, np.complex64), NONE_OF),
    "five-bands": (deep(1, np.float32, values=np.dstack([COLOUR, GREY])), NONE_OF),
    "eps": (as_png(bytes_of("EPS")), NONE_OF),
    "ppm": (as_png(bytes_of("PPM")), NONE_OF),
    "tga": (as_png(bytes_of("TGA")), NONE_OF),
    "ico": (as_png(bytes_of("ICO")), NONE_OF),
    "pdf": (as_png(bytes_of("PDF")), NONE_OF),
    "jpeg-2000": (as_png(bytes_of("JPEG2000")), NONE_OF),
    "svg": (as_png(b"<svg xmlns='http://www.w3.org/2000/svg'/>"), NONE_OF),
    "text": (as_png(b"no picture"), NONE_OF),
    "empty": (as_png(b""), r"a\.png is empty; copy it again, or remove it"),
    "zeros": (as_png(b"\0" * 1000), NONE_OF),
    "signature": (as_png(b"\x89PNG\r\n\x1a\n"), r"a\.png cannot be opened as a picture"),
    "no-width": (as_png(claimed(0, 9)), r"a\.png (cannot be opened|is 0 x 9)"),
    "claims-300-mp": (as_png(claimed(20_000, 15_000)), r"a\.png has more than 160 megapixels; reduce it"),
    "claims-170-mp": (as_png(claimed(17_000, 10_000)), r"a\.png has more than 160 megapixels; reduce it"),
    "claims-10^18": (as_png(claimed(2**30, 2**30)), r"a\.png (has more than 160 megapixels|cannot be opened)"),
    "claims-100-mp": (as_png(claimed(10_000, 10_000)), r"a\.png (is cut off|cannot be opened as a picture)"),
    "claims-16-bit": (as_png(claimed(5_000, 5_000, 16)), r"a\.png (is cut off|cannot be opened as a picture)"),
    "cut-png": (as_png(bytes_of("PNG")[:-300]), r"a\.png (is cut off|cannot be opened as a picture)"),
    "cut-jpeg": (as_png(bytes_of("JPEG")[:700]), r"a\.png (is cut off|cannot be opened as a picture)"),
    "cut-tiff": (as_png(bytes_of("TIFF")[:4000]), r"a\.png (is cut off|cannot be opened as a picture)"),
    "cut-lzw": (
        as_png(bytes_of("TIFF", compression="tiff_lzw")[:2000]),
        r"a\.png (is cut off|cannot be opened as a picture)",
    ),
    "cut-webp": (as_png(bytes_of("WEBP")[:60]), r"a\.png (is cut off|cannot be opened as a picture)"),
    "cut-bmp": (as_png(bytes_of("BMP")[:999]), r"a\.png (is cut off|cannot be opened as a picture)"),
    "cut-gif": (as_png(bytes_of("GIF")[:800]), r"a\.png (is cut off|cannot be opened as a picture)"),
    "cut-float": (
        lambda folder: as_png(deep(1, np.float32)(folder).read_bytes()[:4000])(folder),
        r"a\.png cannot be opened as a picture",
    ),
    "folder": (lambda folder: folder / ".", r"it is a folder; name a file"),
    "missing": (lambda folder: folder / "a.png", r"a\.png cannot be opened as a picture \(No such file"),
    "long-name": (lambda folder: folder / ("a" * 300), r"cannot be opened as a picture \(File name too long\)"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_picture_that_shows_nothing_is_refused_in_one_line(case: str, tmp_path: Path) -> None:
    write, expected = REFUSED[case]
    with pytest.raises(ImageError, match=expected) as raised:
        read_picture(write(tmp_path))
    assert str(raised.value).isprintable()
    assert "; " in str(raised.value)


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("layout", ["PNG", "JPEG", "WEBP", "TIFF", "LZW", "deep"])
def test_every_picture_is_turned_as_its_exif_says(orientation: int, layout: str, tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[0x0112] = orientation
    source = Image.fromarray(np.kron(RGB[::12, ::8], np.ones((16, 16, 1), np.uint8)))
    options: dict[str, Any] = {"exif": exif, "lossless": True} if layout == "WEBP" else {"exif": exif}
    if layout == "deep":
        source = Image.fromarray(np.asarray(source)[..., 0].astype(np.uint16) * 257)
    if layout == "LZW":
        options["compression"] = "tiff_lzw"
    if layout == "JPEG":
        options |= {"quality": 100, "subsampling": 0}
    path = tmp_path / "a"
    source.save(path, {"LZW": "TIFF", "deep": "TIFF"}.get(layout, layout), **options)
    source.save(tmp_path / "b.png", exif=exif)
    wanted = np.asarray(ImageOps.exif_transpose(Image.open(tmp_path / "b.png"))).astype(float)
    wanted = wanted / 257 if layout == "deep" else wanted
    found = read_picture(path).rgb.astype(float)
    found = found[..., 0] if layout == "deep" else found
    assert found.shape == wanted.shape
    assert np.abs(found - wanted).max() <= 4
    small = read_picture(path, max_side=64).rgb
    assert small.shape[:2] == (wanted.shape[0] // 2, wanted.shape[1] // 2)


@pytest.mark.parametrize(
    "case", ["rgb", "alpha", "palette", "progressive", "12-in-16-rgb-png", "no-number", "lzw", "webp"]
)
def test_a_large_picture_is_reduced_by_means(case: str, tmp_path: Path) -> None:
    path = SHOWN[case][0](tmp_path)
    whole, small = read_picture(path), read_picture(path, max_pixels=48 * 64 // 9 + 1)
    assert small.rgb.shape == (16, 21, 3)
    assert small.scale == pytest.approx(1 / 3, rel=0.01)
    clear = ~small.hidden
    means = np.asarray(Image.fromarray(whole.rgb).resize((21, 16), Image.Resampling.BOX)).astype(float)
    edge = np.abs(np.diff(small.hidden.astype(int), axis=0)).any() * 40  # there what is hidden is left out of the mean
    assert np.abs(small.rgb - means)[clear].mean() < 4 + edge / 10
    assert np.abs(small.hidden.mean() - whole.hidden.mean()) < 0.05


def test_pictures_below_the_limits_are_read_as_they_are(tmp_path: Path) -> None:
    path = saved(tmp_path, "a.png", Image.fromarray(np.tile(RGB, (10, 10, 1))))
    assert (read_exemplar_picture(path).rgb == np.tile(RGB, (10, 10, 1))).all()
    assert (read_image_and_mask(path)[0] == np.tile(RGB, (10, 10, 1))).all()
    wide = saved(tmp_path, "b.png", Image.new("RGB", (2 * MAX_EXEMPLAR_SIDE, 100)))
    assert read_exemplar_picture(wide).rgb.shape == (50, MAX_EXEMPLAR_SIDE, 3)
    assert KEPT == 8192 * 4096


@pytest.mark.parametrize("size", [(1, 1), (15, 400), (400, 3), (40_000, 20)])
def test_photos_and_exemplars_of_a_few_pixels_are_refused_with_the_reason(
    size: tuple[int, int], tmp_path: Path
) -> None:
    path = saved(tmp_path, "w1-f1.png", Image.new("RGB", size))
    with pytest.raises(ImageError, match=rf"w1-f1\.png is {size[0]} x {size[1]} pixels.*16 a side are the least; give"):
        read_exemplar_picture(path)
    if min(size) < 16:
        with pytest.raises(ImageError, match=r"w1-f1\.png is .*16 a side are the least"):
            read_facade_photo(path, True, (20, 30))
        with pytest.raises(InputError, match=r"w1-f1\.png is .*16 a side are the least"):
            list_images(tmp_path, "exemplar")
        check_picture(path)  # a material may be one colour


def test_a_broken_picture_is_a_fault_and_the_others_are_used(tmp_path: Path) -> None:
    folder = tmp_path / "pictures"
    folder.mkdir()
    saved(folder, "good.png", Image.fromarray(RGB))
    for name, content in {"eps.png": bytes_of("EPS"), "huge.png": claimed(20_000, 15_000), "empty.jpg": b""}.items():
        (folder / name).write_bytes(content)
    (folder / "line\nbreak.png").write_bytes(bytes_of("PNG"))
    (folder / "folder.png").mkdir()
    (folder / "circle.png").symlink_to("circle.png")
    os.mkfifo(folder / "pipe.png")
    usable, faults = list_images(folder, "exemplar")
    assert [path.name for path in usable] == ["good.png"]
    assert sorted(fault.id for fault in faults) == sorted(
        ["circle.png", "empty.jpg", "eps.png", "huge.png", "line break.png", "pipe.png"]
    )
    assert all(fault.reason.isprintable() for fault in faults)
    with pytest.raises(InputError, match=r"line break\.png: its name holds what is no letter"):
        photos_by_facade(folder)


def test_exif_that_lies_is_no_focal_length(tmp_path: Path) -> None:
    for told in (0, 65535):
        exif = Image.Exif()
        exif.get_ifd(0x8769)[0xA405] = told
        path = saved(tmp_path, "a.jpg", Image.fromarray(RGB), exif=exif)
        assert read_picture(path).state.focal_px is None or told
    path.write_bytes(path.read_bytes().replace(b"Exif\0\0", b"Exif\0\0\xff\xff", 1))
    assert read_picture(path).state.focal_px is None


SEEDS = {
    "png": bytes_of("PNG"),
    "palette.png": bytes_of("PNG", Image.fromarray(RGB).quantize(8), transparency=2),
    "deep.png": bytes_of("PNG", Image.fromarray(RGB[..., 0].astype(np.uint16) * 16)),
    "jpg": bytes_of("JPEG"),
    "progressive.jpg": bytes_of("JPEG", progressive=True),
    "tif": bytes_of("TIFF"),
    "lzw.tif": bytes_of("TIFF", compression="tiff_lzw"),
    "float.tif": bytes_of("TIFF", Image.fromarray(RAMP.astype(np.float32))),
    "webp": bytes_of("WEBP"),
    "gif": bytes_of("GIF"),
    "bmp": bytes_of("BMP"),
}


def changed(content: bytes, chance: random.Random) -> bytes:
    """A file with a few bytes of it changed, put in, left out or cut off, more often in its first 200."""
    result = bytearray(content)
    for _ in range(chance.choice((1, 1, 2, 4))):
        at = chance.randrange(chance.choice((min(200, len(result)), len(result))))
        how = chance.randrange(5)
        if how == 0:
            result[at] = chance.randrange(256)
        elif how == 1:
            result[at : at + 4] = chance.choice((b"\xff" * 4, b"\0" * 4, b"\x7f\xff\xff\xff", b"\xff\xff\xff\x7f"))
        elif how == 2:
            del result[at : at + chance.randrange(1, 20)]
        elif how == 3:
            result[at:at] = chance.randbytes(chance.randrange(1, 9))
        elif at:
            del result[at:]
        if not result:
            break
    return bytes(result)


@pytest.mark.parametrize("seed", SEEDS)
def test_changed_bytes_of_a_picture_are_read_or_refused(seed: str, tmp_path: Path) -> None:
    chance, refused = random.Random(seed), 0
    path = tmp_path / f"a.{seed.rpartition('.')[2]}"
    for _ in range(60):
        path.write_bytes(changed(SEEDS[seed], chance))
        for read in (
            lambda: list_images(tmp_path, "exemplar"),
            lambda: read_picture(path, max_side=32),
        ):
            try:
                read()
            except InputError as error:
                refused += 1
                said = str(error)
                if not said.isprintable():
                    pytest.fail(said)
    assert refused


BOMB = """
import resource, sys
from pathlib import Path
import numpy, cv2, rasterio
from catalogs.readers.pictures.decoding import read_picture
from facade_core.core.errors import ImageError
from tasks.stages.shared.images import read_exemplar_picture, read_image_and_mask
held = int(next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmSize"))) * 1024
resource.setrlimit(resource.RLIMIT_AS, (held + 1_000_000_000,) * 2)
for name in sys.argv[1:]:
    for read in (read_exemplar_picture, read_image_and_mask):
        try:
            found = read(Path(name))
            print(Path(name).name, *(found.rgb if hasattr(found, "rgb") else found[0]).shape)
        except ImageError as error:
            print(error)
"""


@pytest.mark.long
def test_no_picture_takes_a_gigabyte(tmp_path: Path) -> None:
    """144 megapixels in a file of kilobytes, of each format, in a process that may take 1 GB more."""
    image = Image.new("RGB", (12_000, 12_000), "teal")
    files = [
        saved(tmp_path, "p.png", image),
        saved(tmp_path, "b.jpg", image),
        saved(tmp_path, "d.webp", image.crop((0, 0, 7_200, 7_200)), quality=1, method=0),
        as_png(claimed(12_000, 13_000, 16))(tmp_path / "."),
    ]
    assert max(path.stat().st_size for path in files) < 4_000_000
    done = subprocess.run([sys.executable, "-c", BOMB, *map(str, files)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    lines = done.stdout.splitlines()
    assert sum(line.endswith(" 2000 2000 3") for line in lines) == 2, lines
    assert "d.webp has more than 50 megapixels; reduce it" in lines
    assert len(lines) == 2 * len(files)


def test_the_formats_are_named_and_none_starts_a_program() -> None:
    assert set(pictures.PILLOW_FORMATS) <= {"PNG", "JPEG", "TIFF", "WEBP", "BMP", "GIF"}
    assert PICTURES.max_webp_pixels < PICTURES.max_pixels <= 2 * (Image.MAX_IMAGE_PIXELS or 0), (
        "Pillow's own limit lies above"
    )


def test_cases_of_before(data: Path) -> None:
    folder = data / "bad_inputs" / "pictures"
    if not folder.is_dir():
        pytest.skip("no bad inputs in the data folder")
    for path in sorted(folder.iterdir()):
        try:
            assert read_image_and_mask(path)[0].std() > 20, path
        except ImageError as error:
            if not str(error).startswith(path.name):
                raise
    large = data / "bad_inputs" / "zcombo-144mp-exemplar" / "lib" / "b.png"
    with open_picture(large) as image:
        assert image.size == (12_000, 12_000)
    assert read_exemplar_picture(large).rgb.shape == (2000, 2000, 3)
