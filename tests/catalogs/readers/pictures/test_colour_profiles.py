"""Pictures with embedded ICC profiles become sRGB in every reader."""

from __future__ import annotations

import base64
import struct
import warnings
import zlib
from pathlib import Path

import numpy as np
import pytest
import rasterio
from PIL import Image, ImageCms
from pyproj import CRS
from rasterio.transform import from_origin

from catalogs.readers.pictures.aerial import open_orthophoto
from catalogs.readers.pictures.colour_profiles import profile_to_srgb
from catalogs.readers.pictures.decoding import read_picture
from facade_core.core.arrays import Float64Array

D50 = np.array([0.9642, 1.0, 0.8249])
D65 = np.array([0.9505, 1.0, 1.089])
BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
# Chromaticities of red, green and blue, and the white of each space, with the exponent of its curve.
SPACES: dict[str, tuple[list[tuple[float, float]], Float64Array, float]] = {
    "display-p3": ([(0.68, 0.32), (0.265, 0.69), (0.15, 0.06)], D65, 2.2),
    "adobe-rgb": ([(0.64, 0.33), (0.21, 0.71), (0.15, 0.06)], D65, 563 / 256),
    "prophoto": ([(0.7347, 0.2653), (0.1596, 0.8404), (0.0366, 0.0001)], D50, 1.8),
}
TO_XYZ = np.array([[0.4360, 0.3851, 0.1431], [0.2225, 0.7169, 0.0606], [0.0139, 0.0971, 0.7141]])  # sRGB, D50
WALL = (190, 70, 50)


def encode_fixed_point(*values: float) -> bytes:
    return b"".join(struct.pack(">i", round(value * 65536)) for value in values)


def icc(space: bytes, pcs: bytes, tags: dict[bytes, bytes], kind: bytes = b"mntr") -> bytes:
    """Return an ICC profile of version 2."""
    tags = {b"wtpt": b"XYZ \0\0\0\0" + encode_fixed_point(*D50), b"desc": b"desc\0\0\0\0\0\0\0\x01" + bytes(80)} | tags
    table, content = b"", b""
    start = 128 + 4 + 12 * len(tags)
    for name, value in tags.items():
        table += name + struct.pack(">II", start + len(content), len(value))
        content += value + bytes(-len(value) % 4)
    size = start + len(content)
    header = struct.pack(">I4sI4s4s4s", size, b"lcms", 0x02100000, kind, space, pcs) + bytes(12) + b"acsp" + bytes(28)
    return (header + encode_fixed_point(*D50)).ljust(128, b"\0") + struct.pack(">I", len(tags)) + table + content


def gamma(exponent: float) -> bytes:
    return b"curv\0\0\0\0\0\0\0\x01" + struct.pack(">H", round(exponent * 256)) + b"\0\0"


def matrix(name: str) -> Float64Array:
    """Return the matrix from the linear colours of a space to XYZ under D50."""
    primaries, white, _ = SPACES[name]
    columns = np.array([[x / y, 1.0, (1 - x - y) / y] for x, y in primaries]).T
    columns = columns * np.linalg.solve(columns, white)
    adapted = np.linalg.inv(BRADFORD) @ np.diag((BRADFORD @ D50) / (BRADFORD @ white)) @ BRADFORD
    return np.asarray(adapted @ columns)


def rgb_profile(name: str) -> bytes:
    tags = {
        b"%cXYZ" % c: b"XYZ \0\0\0\0" + encode_fixed_point(*column)
        for c, column in zip(b"rgb", matrix(name).T, strict=True)
    }
    return icc(b"RGB ", b"XYZ ", tags | {b"%cTRC" % c: gamma(SPACES[name][2]) for c in b"rgb"})


def encode(name: str, srgb: tuple[int, int, int] = WALL) -> tuple[int, ...]:
    """Return an sRGB colour in another space."""
    values = np.array(srgb) / 255
    linear = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    own = np.clip(np.linalg.solve(matrix(name), TO_XYZ @ linear), 0, 1)
    return tuple(np.rint(255 * own ** (1 / SPACES[name][2])).astype(int).tolist())


def cmyk_profile() -> bytes:
    """Return a printing profile whose inks multiply, with the colours of offset inks."""
    inks = np.array([(0.0, 0.62, 0.88), (0.88, 0.0, 0.49), (1.0, 0.93, 0.0), (0.15, 0.15, 0.15)])
    grid = np.stack(np.meshgrid(*[[0, 1]] * 4, indexing="ij"), axis=-1).reshape(16, 4)
    colour = np.prod(np.where(grid[:, :, None] > 0, inks, 1.0), axis=1)
    lab = ImageCms.profileToProfile(
        Image.fromarray(np.rint(colour * 255).astype(np.uint8)[None]),
        ImageCms.createProfile("sRGB"),
        ImageCms.createProfile("LAB"),
        outputMode="LAB",
    )
    assert lab is not None
    values = np.frombuffer(lab.tobytes(), np.uint8).reshape(16, 3) ^ np.array([0, 128, 128], np.uint8)
    curve = bytes(range(256))
    head = b"mft1\0\0\0\0" + bytes([4, 3, 2, 0]) + encode_fixed_point(1, 0, 0, 0, 1, 0, 0, 0, 1)
    return icc(b"CMYK", b"Lab ", {b"A2B0": head + curve * 4 + values.tobytes() + curve * 3}, b"prtr")


def near(rgb: np.ndarray, colour: tuple[int, ...], error: int = 4) -> bool:
    return bool(np.abs(rgb.reshape(-1, 3).astype(int) - colour).max() <= error)


@pytest.mark.parametrize("name", SPACES)
@pytest.mark.parametrize("suffix", ["jpg", "png", "tif", "webp"])
def test_rgb_profiles(name: str, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"a.{suffix}"
    options = {"quality": 98, "subsampling": 0} if suffix == "jpg" else {"lossless": True} if suffix == "webp" else {}
    Image.new("RGB", (64, 48), encode(name)).save(path, icc_profile=rgb_profile(name), **options)
    assert not near(np.array([encode(name)]), WALL)
    assert near(read_picture(path).rgb, WALL)
    assert near(read_picture(path, max_side=20).rgb, WALL)


@pytest.mark.parametrize("suffix", ["png", "tif"])
def test_sixteen_bits(suffix: str, tmp_path: Path) -> None:
    values = np.broadcast_to(np.array(encode("prophoto"), np.uint16) * 257, (48, 64, 3)).copy()
    values[0] = 65535
    path = tmp_path / f"a.{suffix}"
    driver = {"png": "PNG", "tif": "GTiff"}[suffix]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        options = {"photometric": "RGB"} if suffix == "tif" else {}
        with rasterio.open(path, "w", driver=driver, count=3, height=48, width=64, dtype="uint16", **options) as file:
            file.update_tags(ns="COLOR_PROFILE", SOURCE_ICC_PROFILE=base64.b64encode(rgb_profile("prophoto")).decode())
            file.write(np.moveaxis(values, -1, 0))
    assert near(read_picture(path).rgb[1:], WALL)


def test_alpha_and_palettes(tmp_path: Path) -> None:
    profile = rgb_profile("adobe-rgb")
    image = Image.new("RGBA", (64, 48), (*encode("adobe-rgb"), 255))
    image.paste((0, 0, 0, 0), (0, 0, 10, 48))
    image.save(tmp_path / "a.png", icc_profile=profile)
    found = read_picture(tmp_path / "a.png")
    assert found.hidden[:, :10].all()
    assert not found.hidden[:, 10:].any()
    assert near(found.rgb[:, 10:], WALL)
    Image.new("RGB", (64, 48), encode("adobe-rgb")).quantize(4).save(tmp_path / "b.png", icc_profile=profile)
    assert near(read_picture(tmp_path / "b.png").rgb, WALL)


@pytest.mark.parametrize("suffix", ["jpg", "tif"])
def test_cmyk(suffix: str, tmp_path: Path) -> None:
    for ink, colour, naive in [
        ((255, 0, 0, 0), (0, 158, 224), (0, 255, 255)),
        ((0, 255, 255, 0), (224, 0, 0), (255, 0, 0)),
    ]:
        image, path = Image.new("CMYK", (64, 48), ink), tmp_path / f"a.{suffix}"
        image.save(path, **({"quality": 98, "subsampling": 0} if suffix == "jpg" else {}))
        assert near(read_picture(path).rgb, naive)
        image.save(path, icc_profile=cmyk_profile(), **({"quality": 98, "subsampling": 0} if suffix == "jpg" else {}))
        assert near(read_picture(path).rgb, colour, 14)


def test_grey(tmp_path: Path) -> None:
    profile = icc(b"GRAY", b"XYZ ", {b"kTRC": gamma(1.0)})
    Image.new("L", (64, 48), 55).save(tmp_path / "a.png", icc_profile=profile)
    assert near(read_picture(tmp_path / "a.png").rgb, (128, 128, 128))


def test_srgb_and_unusable_profiles_change_nothing(tmp_path: Path) -> None:
    srgb = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    broken = rgb_profile("prophoto")[:200]
    other = cmyk_profile()  # of a picture that was CMYK before it was saved as RGB
    for content in (srgb, broken, other, b"", b"\0" * 500):
        assert profile_to_srgb(content, ("RGB",)) is None
        Image.new("RGB", (64, 48), WALL).save(tmp_path / "a.png", icc_profile=content)
        assert near(read_picture(tmp_path / "a.png").rgb, WALL, 0)


def test_orthophotos(tmp_path: Path) -> None:
    path, frame = tmp_path / "a.tif", CRS.from_epsg(32635)
    options = {"driver": "GTiff", "count": 3, "height": 40, "width": 40, "dtype": "uint8", "crs": "EPSG:32635"}
    with rasterio.open(path, "w", **options, transform=from_origin(385000, 6671040, 1, 1), photometric="RGB") as file:
        file.update_tags(ns="COLOR_PROFILE", SOURCE_ICC_PROFILE=base64.b64encode(rgb_profile("display-p3")).decode())
        file.write(np.broadcast_to(np.array(encode("display-p3"), np.uint8)[:, None, None], (3, 40, 40)))
    place = np.array([[385020.0, 6671020.0]])
    colour, known = open_orthophoto(path, None, frame, place).sample(place, 1.0)
    assert known.all()
    assert near(colour, WALL)


def test_photo_in_prophoto(data: Path) -> None:
    folder = data / "field_inputs"
    if not folder.is_dir():
        pytest.skip("no field inputs in the data folder")
    for name in ("photo-prophoto", "photo-srgb"):
        assert near(read_picture(folder / name / "photos" / "a-0.jpg").rgb[:1, :1], WALL)


@pytest.mark.parametrize(("index", "expected"), [("R03", (219, 69, 47)), ("R98", (190, 70, 50))])
def test_the_colour_space_that_exif_states(tmp_path: Path, index: str, expected: tuple[int, int, int]) -> None:
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0xA005] = {1: index}
    Image.new("RGB", (32, 32), (190, 70, 50)).save(tmp_path / "a.jpg", exif=exif, quality=100, subsampling=0)
    assert np.abs(read_picture(tmp_path / "a.jpg").rgb[9, 9].astype(int) - expected).max() <= 4


@pytest.mark.parametrize(("gamma", "expected"), [(100_000, 128), (45_455, 55)])
def test_a_linear_png_becomes_srgb(tmp_path: Path, gamma: int, expected: int) -> None:
    Image.new("RGB", (32, 32), (55, 55, 55)).save(tmp_path / "a.png")
    content = (tmp_path / "a.png").read_bytes()
    chunk = b"gAMA" + gamma.to_bytes(4, "big")
    added = len(chunk[4:]).to_bytes(4, "big") + chunk + zlib.crc32(chunk).to_bytes(4, "big")
    (tmp_path / "a.png").write_bytes(content[:33] + added + content[33:])
    assert np.abs(read_picture(tmp_path / "a.png").rgb.astype(int) - expected).max() <= 1
