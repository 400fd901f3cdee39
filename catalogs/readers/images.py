"""Folders of pictures that a block file names: exemplar facades, photos of single facades, panoramas."""

from __future__ import annotations

from pathlib import Path

from catalogs.features import Fault
from facade_core.errors import InputError

SUFFIXES = (".jpg", ".jpeg", ".png", ".webp", ".tif", ".tiff")
_START_OF_SCAN = 0xDA
_END_OF_IMAGE = b"\xff\xd9"


def image_files(folder: Path, kind: str) -> tuple[tuple[Path, ...], tuple[Fault, ...]]:
    """The pictures of a folder by name, and a fault of `kind` by file name for each that cannot be opened or is cut off.

    Raises InputError where no picture is left.
    """
    found = _pictures(folder)
    damage = {path: _damage(path) for path in found}
    usable = tuple(path for path, problem in damage.items() if problem is None)
    if not usable:
        raise InputError(f"{found[0]} {damage[found[0]]}, and so are all pictures of that folder; replace them")
    return usable, tuple(
        Fault(path.name, kind, f"{path.name} {problem}; replace or remove it")
        for path, problem in damage.items()
        if problem is not None
    )


def whole_picture(path: Path) -> None:
    """Raise InputError where a picture cannot be opened or is cut off."""
    if problem := _damage(path):
        raise InputError(f"{path} {problem}; replace it")


def photos_by_facade(folder: Path) -> dict[str, Path]:
    """Facade id -> photo; the id is the file's name without suffix.

    A photo that is cut off is among them: it is its facade that fails when it comes to it. Raises InputError where two files
    name one facade, or there is no picture.
    """
    photos: dict[str, Path] = {}
    for path in _pictures(folder):
        if path.stem in photos:
            raise InputError(f"{photos[path.stem]} and {path.name} both name facade {path.stem}; remove one")
        photos[path.stem] = path
    return photos


def _pictures(folder: Path) -> list[Path]:
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder; give the folder that holds the pictures")
    found = sorted((p for p in folder.iterdir() if _is_image(p)), key=lambda p: p.name)
    if not found:
        inside = sorted(p for p in folder.iterdir() if p.is_dir() and any(_is_image(q) for q in p.iterdir()))
        remedy = f"did you mean {inside[0]}?" if inside else f"put {', '.join(SUFFIXES[:4])} files there"
        raise InputError(f"{folder} holds no pictures; {remedy}")
    return found


def _is_image(path: Path) -> bool:
    return path.suffix.lower() in SUFFIXES and not path.name.startswith(".") and path.is_file()


def _damage(path: Path) -> str | None:
    """What keeps a picture from being used, told without decoding it: that would take longer than the rest of reading."""
    from PIL import Image

    try:
        with Image.open(path) as image:
            layout = image.format
        content = path.read_bytes()
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):
        return "cannot be opened as a picture"
    whole = {"JPEG": _whole_jpeg, "MPO": _whole_jpeg, "PNG": lambda data: b"IEND" in data[-4096:]}
    return None if whole.get(str(layout), lambda data: True)(content) else "is cut off"


def _whole_jpeg(content: bytes) -> bool:
    """Whether an end marker follows the first scan; the segments before it may hold a thumbnail with one of its own."""
    position = 2
    while position + 4 <= len(content) and content[position] == 0xFF:
        if content[position + 1] == _START_OF_SCAN:
            return content.find(_END_OF_IMAGE, position) >= 0
        if content[position + 1] == 0xFF:  # fill byte
            position += 1
        else:
            position += 2 + int.from_bytes(content[position + 2 : position + 4], "big")
    return False
