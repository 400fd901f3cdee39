"""A block's orthophoto and roof material: read, part of the digest, refused by key."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from distributed.protocol import deserialize, serialize
from PIL import Image
from pyproj import Transformer

from catalogs.block.reader import Block
from facade_core.core.errors import BlockFileError

pytestmark = pytest.mark.long

rasterio = pytest.importorskip("rasterio")
Read = Callable[..., Block]
IMAGERY = "imagery: {exemplars: {path: facades}, aerial: {path: above.tif%s}}"


def write_above(folder: Path, *, west: float = 24.940, crs: str | None = "EPSG:3067", value: int = 9) -> None:
    """Half a kilometre square of half-metre pixels, from a longitude eastwards."""
    x, y = Transformer.from_crs("EPSG:4326", "EPSG:3067", always_xy=True).transform(west, 60.1695)
    place = rasterio.Affine(0.5, 0, x, 0, -0.5, y)
    options = {"count": 3, "height": 1000, "width": 1000, "dtype": "uint8", "crs": crs, "transform": place}
    with rasterio.open(folder / "above.tif", "w", driver="GTiff", **options) as raster:
        raster.write(np.full((3, 1000, 1000), value, np.uint8))


def test_both_are_read_and_change_the_digest(read: Read, folder: Path) -> None:
    Image.new("RGB", (50, 40)).save(folder / "clay.png")
    plain = read()
    assert plain.aerial is None
    assert plain.roof_material is None
    write_above(folder)
    block = read(imagery=IMAGERY % "")
    assert block.aerial is not None
    assert block.aerial.path == folder / "above.tif"
    assert deserialize(*serialize(block)) == block, "it travels to workers"
    middle = np.array([block.buildings[0].footprint.centroid.coords[0]])
    colour, known = block.aerial.sample(middle, 0.05)
    assert (colour[known] == 9).all()
    digests = [plain.digest, block.digest]
    write_above(folder, value=10)
    digests.append(read(imagery=IMAGERY % "").digest)
    for scale in (0.01, 0.02):
        material = read(f"texture: {{roof_material: {{path: clay.png, metres_per_pixel: {scale}}}}}")
        assert material.roof_material == (folder / "clay.png", scale)
        digests.append(material.digest)
    assert len(set(digests)) == len(digests)


def test_a_frame_that_is_named_stands_in_for_one_that_is_missing(read: Read, folder: Path) -> None:
    write_above(folder, crs=None)
    with pytest.raises(BlockFileError, match=r"imagery\.aerial\.path: .*states no frame; write imagery\.aerial\.crs"):
        read(imagery=IMAGERY % "")
    assert read(imagery=IMAGERY % ", crs: EPSG:3067").aerial is not None
    with pytest.raises(BlockFileError, match=r"imagery\.aerial\.crs: 'EPSG:1' is not a known CRS"):
        read(imagery=IMAGERY % ", crs: EPSG:1")


def test_what_cannot_be_used_is_refused_with_its_key(read: Read, folder: Path) -> None:
    write_above(folder, west=26.0)
    with pytest.raises(BlockFileError, match=r"imagery\.aerial\.path: .*above\.tif shows nothing of the block"):
        read(imagery=IMAGERY % "")
    (folder / "above.tif").write_bytes(b"II*\0 and no more")
    with pytest.raises(BlockFileError, match=r"above\.tif cannot be read as an orthophoto \(.*give a GeoTIFF"):
        read(imagery=IMAGERY % "")
    (folder / "clay.png").write_bytes(b"no picture")
    with pytest.raises(BlockFileError, match=r"texture\.roof_material\.path: .*clay\.png cannot be opened"):
        read("texture: {roof_material: {path: clay.png, metres_per_pixel: 0.01}}")
    for value, message in (
        ("clay.png", "where keys are expected"),
        ("{path: clay.png}", "metres_per_pixel: missing; write metres_per_pixel: 0.01"),
    ):
        with pytest.raises(BlockFileError, match=r"texture\.roof_material.*" + message):
            read(f"texture: {{roof_material: {value}}}")
    with pytest.raises(BlockFileError, match=r"texture\.levelling: 'maybe' is not true or false"):
        read("texture: {levelling: maybe}")


def test_pictures_of_materials_are_read_and_change_the_digest(read: Read, folder: Path) -> None:
    (folder / "own").mkdir()
    plain = read()
    assert plain.materials == ()
    digests = [plain.digest]
    for name, grey in (("slabs-0.8m.png", 90), ("slabs-0.9m.png", 90), ("slabs-0.9m.png", 91), ("setts-0.9m.png", 91)):
        for before in (folder / "own").iterdir():
            before.unlink()
        Image.new("RGB", (64, 64), (grey, grey, grey)).save(folder / "own" / name)
        block = read("texture: {materials: own/}")
        assert [(one.name, one.path.name) for one in block.materials] == [(name.partition("-")[0], name)]
        digests.append(block.digest)
    assert len(set(digests)) == len(digests)
    Image.new("RGB", (64, 64)).save(folder / "own" / "sets.png")
    with pytest.raises(BlockFileError, match=r"texture\.materials: .*own: sets\.png names no .*did you mean setts\?"):
        read("texture: {materials: own/}")
    with pytest.raises(BlockFileError, match=r"texture\.materials: .*owns does not exist; did you mean own\?"):
        read("texture: {materials: owns/}")
