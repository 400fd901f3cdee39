"""Folders of pictures that a block file names: exemplar facades, photos of single facades."""

from __future__ import annotations

from pathlib import Path

from facade_core.errors import InputError

SUFFIXES = (".jpg", ".jpeg", ".png", ".webp", ".tif", ".tiff")


def image_files(folder: Path) -> tuple[Path, ...]:
    """The pictures of a folder, by name; InputError where there is none or one cannot be opened."""
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder; give the folder that holds the pictures")
    found = tuple(sorted((p for p in folder.iterdir() if _is_image(p)), key=lambda p: p.name))
    if not found:
        inside = sorted(p for p in folder.iterdir() if p.is_dir() and any(_is_image(q) for q in p.iterdir()))
        remedy = f"did you mean {inside[0]}?" if inside else f"put {', '.join(SUFFIXES[:4])} files there"
        raise InputError(f"{folder} holds no pictures; {remedy}")
    for path in found:
        _check_opens(path)
    return found


def photos_by_facade(folder: Path) -> dict[str, Path]:
    """Facade id -> photo; the id is the file's name without suffix. InputError where two files name one facade."""
    photos: dict[str, Path] = {}
    for path in image_files(folder):
        if path.stem in photos:
            raise InputError(f"{photos[path.stem]} and {path.name} both name facade {path.stem}; remove one")
        photos[path.stem] = path
    return photos


def _is_image(path: Path) -> bool:
    return path.suffix.lower() in SUFFIXES and not path.name.startswith(".") and path.is_file()


def _check_opens(path: Path) -> None:
    """Read the header only: a full decode of every picture would take longer than the rest of reading a block."""
    from PIL import Image

    try:
        with Image.open(path):
            pass
    except (OSError, Image.DecompressionBombError) as error:
        raise InputError(f"{path} cannot be opened as a picture; replace or remove it") from error
