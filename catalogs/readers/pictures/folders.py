"""Folders of pictures in a block file: exemplar facades, photos of single facades and panoramas."""

from __future__ import annotations

import mmap
from pathlib import Path

from catalogs.features import Fault
from catalogs.reader_errors import to_single_line
from catalogs.readers.pictures.decoding import MIN_SIDE_PX, REMEDY, open_picture
from facade_core.core.errors import InputError
from facade_core.core.regular_files import open_regular

IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".webp", ".tif", ".tiff")
LABEL_MAP_SUFFIX = ".labels.png"
_START_OF_SCAN = 0xDA
_END_OF_IMAGE = b"\xff\xd9"


def list_images(folder: Path, kind: str) -> tuple[tuple[Path, ...], tuple[Fault, ...]]:
    """List the usable pictures of a folder by name, and a fault for each other one.

    A picture is unusable where it cannot be opened, is truncated, too large or too small.

    Parameters
    ----------
    folder : folder of pictures.
    kind : kind of the faults.

    Raises
    ------
    InputError
        Where no picture is usable.
    """
    found = _list_pictures(folder)
    damage = {
        path: _name_problem(path) or _missing_file_problem(path) or _find_damage(path, MIN_SIDE_PX) for path in found
    }
    usable = tuple(path for path, problem in damage.items() if problem is None)
    if not usable:
        raise InputError(f"{folder} holds no picture that can be used: {damage[found[0]]}")
    return usable, tuple(
        Fault(to_single_line(path.name), kind, problem) for path, problem in damage.items() if problem is not None
    )


def check_picture(path: Path) -> None:
    """Raise InputError where a picture cannot be opened or is truncated."""
    if problem := _find_damage(path, 1):
        raise InputError(f"{path.parent}: {problem}")


def photos_by_facade(folder: Path) -> tuple[dict[str, Path], tuple[Fault, ...]]:
    """Return the photo of each facade by id, and a fault for each missing file.

    The id is the file name without suffix. Truncated photos are included: their facade fails when it is processed.

    Raises
    ------
    InputError
        Where two files name one facade, or there is no picture.
    """
    photos: dict[str, Path] = {}
    faults = []
    for path in _list_pictures(folder):
        if problem := _name_problem(path):
            raise InputError(f"{folder}: {problem}")
        if path.stem in photos:
            raise InputError(f"{photos[path.stem]} and {path.name} both name facade {path.stem}; remove one")
        if problem := _missing_file_problem(path):
            faults.append(Fault(path.name, "photo", problem))
        else:
            photos[path.stem] = path
    return photos, tuple(faults)


def _list_pictures(folder: Path) -> list[Path]:
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder; give the folder that holds the pictures")
    found = sorted((p for p in folder.iterdir() if _is_image(p)), key=lambda p: p.name)
    if not found:
        inside = sorted(p for p in folder.iterdir() if p.is_dir() and any(_is_image(q) for q in p.iterdir()))
        remedy = f"did you mean {inside[0]}?" if inside else f"put {', '.join(IMAGE_SUFFIXES[:4])} files there"
        raise InputError(f"{folder} holds no pictures; {remedy}")
    return found


def _name_problem(path: Path) -> str | None:
    """Return the reason why a file name cannot be reported; None for a usable one."""
    name = to_single_line(path.name)
    return None if name == path.name else f"{name}: its name holds what is no letter, such as a line break; rename it"


def _missing_file_problem(path: Path) -> str | None:
    """Return the reason why a name leads to no file, such as a broken link; None where it does."""
    if path.is_file():
        return None
    return f"{path.name} leads to no file; mend what it links to, or remove it"


def label_map_path(picture: Path) -> Path | None:
    """Return the label map NAME.labels.png of a picture; None without one."""
    labels = picture.with_name(f"{picture.stem}{LABEL_MAP_SUFFIX}")
    return labels if labels.is_file() else None


def picture_and_label_paths(picture: Path) -> list[Path]:
    """Return a picture, and its label map if there is one."""
    labels = label_map_path(picture)
    return [picture] if labels is None else [picture, labels]


def _is_image(path: Path) -> bool:
    whole = path.suffix.lower() in IMAGE_SUFFIXES and not path.name.startswith(".") and not path.is_dir()
    return whole and not path.name.endswith(LABEL_MAP_SUFFIX)


def _find_damage(path: Path, min_side: int) -> str | None:
    """Return the reason why a picture is unusable, without decoding, which would dominate the reading time."""
    try:
        with open_picture(path) as image:
            layout, (width, height) = image.format, image.size
        with open_regular(path) as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
            whole = {"JPEG": _is_complete_jpeg, "MPO": _is_complete_jpeg, "PNG": _is_complete_png}.get(
                str(layout), bool
            )(content)
    except InputError as error:
        return str(error)
    if min(width, height) < min_side:
        return f"{path.name} is {width} x {height} pixels, and {min_side} a side are the least; give a larger picture"
    return None if whole else f"{path.name} is cut off; {REMEDY}"


def _is_complete_png(content: mmap.mmap) -> bool:
    return content.find(b"IEND", max(0, len(content) - 4096)) >= 0


def _is_complete_jpeg(content: mmap.mmap) -> bool:
    """Return True where an end marker follows the first scan; earlier segments may hold a thumbnail with its own."""
    position = 2
    while position + 4 <= len(content) and content[position] == 0xFF:
        if content[position + 1] == _START_OF_SCAN:
            return content.find(_END_OF_IMAGE, position) >= 0
        if content[position + 1] == 0xFF:  # fill byte
            position += 1
        else:
            position += 2 + int.from_bytes(content[position + 2 : position + 4], "big")
    return False
