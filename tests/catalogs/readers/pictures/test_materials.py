"""Pictures of materials by name: which is which, how wide, and one line for each that cannot be laid."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from catalogs.readers.pictures.materials import read_material_pictures
from facade_core.core.errors import InputError


def put(folder: Path, name: str, size: tuple[int, int] = (64, 64)) -> Path:
    Image.new("RGB", size, (120, 110, 100)).save(folder / name)
    return folder / name


def test_names_say_what_and_how_wide(tmp_path: Path) -> None:
    slabs, rough = put(tmp_path, "slabs-0.8m.png"), put(tmp_path, "plaster-rough.jpg", (128, 64))
    assert read_material_pictures(tmp_path) == (("slabs", slabs, 0.8), ("plaster-rough", rough, 1.0))


@pytest.mark.parametrize(
    ("name", "size", "message"),
    [
        ("aspalt.jpg", (64, 64), r"aspalt\.jpg names no material that is known; did you mean asphalt\?"),
        ("zebra.jpg", (64, 64), r"zebra\.jpg names no material .* rename it to one of asphalt, gravel, "),
        ("slabs-90m.jpg", (64, 64), r"slabs-90m\.jpg says 90 m; a picture is 0\.1 to 20 m wide, rename it"),
        ("slabs.jpg", (96, 64), r"slabs\.jpg is 96 x 64 pixels and cannot be laid; give one that"),
        ("slabs-2m.jpg", (64, 64), r"slabs-1m\.png and slabs-2m\.jpg both show slabs; remove one"),
    ],
)
def test_what_cannot_be_laid_is_told(tmp_path: Path, name: str, size: tuple[int, int], message: str) -> None:
    put(tmp_path, "slabs-1m.png" if "2m" in name else "grass.png")
    put(tmp_path, name, size)
    with pytest.raises(InputError, match=message) as found:
        read_material_pictures(tmp_path)
    assert str(tmp_path) in str(found.value)


def test_a_broken_picture_is_told(tmp_path: Path) -> None:
    put(tmp_path, "grass.png")
    (tmp_path / "slabs.jpg").write_bytes(b"no picture")
    with pytest.raises(InputError, match=r"slabs\.jpg cannot be opened"):
        read_material_pictures(tmp_path)
