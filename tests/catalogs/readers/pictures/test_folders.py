"""Folders of pictures: every file is read, a companion of pictures, or named with the reason."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from catalogs import file_digest
from catalogs.block.reader import read_block
from catalogs.readers.pictures import decoding, picture_kinds
from catalogs.readers.pictures.decoding import read_picture
from catalogs.readers.pictures.folders import list_images, photos_by_facade
from facade_core.core.errors import ImageError, InputError

RGB = np.random.default_rng(1).integers(0, 255, (20, 24, 3), np.uint8)


def save(path: Path, layout: str | None = None, **options: Any) -> Path:
    Image.fromarray(RGB).save(path, layout, **options)
    return path


@pytest.mark.parametrize(
    ("name", "layout"),
    [("a.jpe", "JPEG"), ("a.JFIF", "JPEG"), ("a.bmp", "BMP"), ("a.DIB", "BMP"), ("a.gif", "GIF"), ("a.TIF", "TIFF")],
)
def test_suffixes_that_are_read(name: str, layout: str, tmp_path: Path) -> None:
    path = save(tmp_path / name, layout)
    assert list_images(tmp_path, "exemplar") == ((path,), ())
    assert photos_by_facade(tmp_path) == ({"a": path}, ())
    assert read_picture(path).rgb.shape == RGB.shape


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("b.dng", b"II*\0", "b.dng is of the kind .dng, which is not read; save it as JPEG or PNG, or remove it"),
        ("b.mp4", b"", "b.mp4 is of the kind .mp4"),
        ("b.avi", b"RIFF\0\0\0\0AVI ", "of the kind .avi"),
        ("b.psd", b"8BPS", "b.psd is of the kind .psd, which is not read; save it as JPEG or PNG, or remove it"),
        ("b.jxl", b"\xff\x0a", "of the kind .jxl"),
        ("b.jp2", b"\0\0\0\x0cjP  ", "of the kind .jp2"),
        ("b.avif", b"\0\0\0\x1cftypavif", "of the kind .avif"),
        ("b.zip", b"PK", "of the kind .zip"),
        ("b", b"", "b is without a suffix"),
        ("b", b"\xff\xd8\xff\xe0", "b is JPEG under another name; rename it to b.jpg"),
        ("b.jpg_large", b"\xff\xd8\xff\xe0", "rename it to b.jpg"),
        ("b.png~", b"\x89PNG\r\n", "rename it to b.png"),
        ("b.bak", b"RIFF\0\0\0\0WEBP", "rename it to b.webp"),
        (
            "b.img",
            b"\0\0\0\x18ftypheic\0\0\0\0",
            "b.img is HEIC under another name; rename it to b.heic, and install pil",
        ),
    ],
)
def test_other_files_are_named_with_the_reason(name: str, content: bytes, reason: str, tmp_path: Path) -> None:
    path = save(tmp_path / "a.jpg")
    (tmp_path / name).write_bytes(content)
    for faults in (photos_by_facade(tmp_path)[1], list_images(tmp_path, "photo")[1]):
        (fault,) = faults
        assert (fault.id, fault.kind) == (name, "photo")
        assert reason in fault.reason
    path.unlink()
    with pytest.raises(InputError, match="holds no pictures; ") as raised:
        list_images(tmp_path, "photo")
    assert reason in str(raised.value)


def test_companions_are_no_faults(tmp_path: Path) -> None:
    path = save(tmp_path / "a.jpg")
    save(tmp_path / "a.labels.png")
    for name in ("poses.csv", "poses.json", "fetched.jsonl", "a.xmp", "a.jgw", "a.jpg.aux.xml", "LICENSE", "README.md",
                 "Thumbs.db", ".DS_Store", "._a.jpg", "notes.txt"):  # fmt: skip
        (tmp_path / name).write_bytes(b"\xff\xd8\xff")
    (tmp_path / "empty").mkdir()
    assert list_images(tmp_path, "photo") == ((path,), ())


def test_pictures_in_folders_are_named(tmp_path: Path) -> None:
    save(tmp_path / "a.jpg")
    (tmp_path / "more").mkdir()
    save(tmp_path / "more" / "b.jpg")
    (fault,) = list_images(tmp_path, "photo")[1]
    assert fault.reason == "more is a folder, whose pictures are not read; move them up, or remove it"


def test_pipes_are_named(tmp_path: Path) -> None:
    save(tmp_path / "a.jpg")
    os.mkfifo(tmp_path / "b.psd")
    os.mkfifo(tmp_path / "c.jpg")
    assert [fault.id for fault in list_images(tmp_path, "photo")[1]] == ["c.jpg", "b.psd"]


def test_heic_without_its_package_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(picture_kinds, "can_read_heif", lambda: False)
    monkeypatch.setattr(decoding, "can_read_heif", lambda: False)
    save(tmp_path / "a.jpg")
    (tmp_path / "b.HEIC").write_bytes(b"\0\0\0\x18ftypheic\0\0\0\0")
    (fault,) = photos_by_facade(tmp_path)[1]
    assert fault.reason == (
        "b.HEIC is HEIC, which is not read here; install pillow-heif (pip install 'streetloom[heif]'), or save it as JPEG"
    )
    with pytest.raises(ImageError, match="which is not read here; install pillow-heif"):
        read_picture(tmp_path / "b.HEIC")


def test_heic_is_read(tmp_path: Path) -> None:
    heif = pytest.importorskip("pillow_heif", reason="pillow-heif is not installed")
    heif.register_heif_opener(thumbnails=False)
    exif = Image.Exif()
    exif[0x0112] = 6
    image = Image.new("RGB", (64, 48), (190, 70, 50))
    image.paste((20, 200, 20), (0, 0, 32, 48))
    stored = heif.from_pillow(image)
    stored.info["exif"] = exif.tobytes()
    stored.save(tmp_path / "b.HEIC", quality=95)
    image.save(tmp_path / "c.jpg", "HEIF", quality=95)  # as some telephones name them
    assert photos_by_facade(tmp_path)[0].keys() == {"b", "c"}
    turned = read_picture(tmp_path / "b.HEIC").rgb
    assert turned.shape == (64, 48, 3), "turned by its orientation, once"
    assert np.abs(turned[10, 24].astype(int) - (20, 200, 20)).max() < 12
    assert np.abs(read_picture(tmp_path / "c.jpg").rgb[24, 50].astype(int) - (190, 70, 50)).max() < 12
    (tmp_path / "d.heic").write_bytes((tmp_path / "b.HEIC").read_bytes()[:300])
    with pytest.raises(ImageError, match=r"d\.heic cannot be opened as a picture"):
        read_picture(tmp_path / "d.heic")


@pytest.mark.parametrize("number", [errno.EIO, errno.EACCES])
def test_a_picture_that_the_disk_does_not_give_is_set_aside(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    good, bad = save(tmp_path / "a.jpg"), save(tmp_path / "b.jpg", quality=30)
    opened = file_digest.open_regular

    def broken(path: Path, *arguments: Any) -> Any:
        if path == bad:
            raise OSError(number, os.strerror(number), str(path))
        return opened(path, *arguments)

    for module in (file_digest, decoding):
        monkeypatch.setattr(module, "open_regular", broken)
    reason = f"b.jpg cannot be read ({os.strerror(number)}); c"
    photos, faults = photos_by_facade(tmp_path)
    assert photos == {"a": good}
    assert [(fault.id, fault.reason[: len(reason)]) for fault in faults] == [("b.jpg", reason)]
    paths, faults = list_images(tmp_path, "exemplar")
    assert paths == (good,)
    assert [fault.reason[: len(reason)] for fault in faults] == [reason]
    with pytest.raises(ImageError, match=r"b\.jpg cannot be read"):
        read_picture(bad)


def test_photo_mixed(data: Path) -> None:
    folder = data / "field_inputs" / "photo-mixed"
    if not folder.is_dir():
        pytest.skip("no field inputs in the data folder")
    block = read_block(folder / "block.yaml")
    assert {"a-0", "b-1", "b-2"} <= set(block.photos)
    assert "a-1" in block.photos or any("a-1.HEIC is HEIC" in fault.reason for fault in block.faults)


def test_files_of_systems_and_servers_are_passed_over(tmp_path: Path) -> None:
    for folder in ("@eaDir", "__MACOSX", "#recycle", ".AppleDouble", "lost+found"):
        (tmp_path / folder).mkdir()
        save(tmp_path / folder / "a.jpg")
    for name in ("Thumbs.db", "desktop.ini", ".DS_Store", "._a.jpg", "Icon\r", "~$a.jpg"):
        (tmp_path / name).write_bytes(b"\0\5\x16\7")
    path = save(tmp_path / "a.jpg")
    assert list_images(tmp_path, "panorama") == ((path,), ())
    assert list_images(tmp_path, "panorama", with_subfolders=True) == ((path,), ())
    assert photos_by_facade(tmp_path) == ({"a": path}, ())
