"""Folders of pictures in a block file: exemplar facades, photos of single facades and panoramas."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from io import BufferedReader
from pathlib import Path

from catalogs.features import Fault, safe_file_stem
from catalogs.file_digest import file_digest
from catalogs.printable_text import normal_form
from catalogs.reader_errors import to_single_line
from catalogs.readers.pictures.decoding import REMEDY, is_unreadable_file, open_picture, unreadable_message
from catalogs.readers.pictures.picture_kinds import (
    IMAGE_SUFFIXES,
    LABEL_MAP_SUFFIX,
    is_picture_name,
    is_system_file,
    unread_reason,
)
from catalogs.readers.settings import PICTURES
from facade_core.core.errors import InputError
from facade_core.core.regular_files import open_regular

_START_OF_SCAN = 0xDA
_END_OF_IMAGE = b"\xff\xd9"
_CHUNK_BYTES = 1_000_000


def list_images(
    folder: Path, kind: str, *, with_subfolders: bool = False
) -> tuple[tuple[Path, ...], tuple[Fault, ...]]:
    """List the usable pictures of a folder by name, and a fault for each other file.

    A picture is unusable where it cannot be read or opened, is truncated, too large or too small. Files that accompany
    pictures, such as label maps and poses, are no faults.

    Parameters
    ----------
    folder : folder of pictures.
    kind : kind of the faults.
    with_subfolders : whether pictures in folders of the folder are listed too.

    Raises
    ------
    InputError
        Where no picture is usable.
    """
    found, faults = _list_pictures(folder, kind, with_subfolders=with_subfolders)
    damage = {
        path: _name_problem(path)
        or _missing_file_problem(path)
        or _read_problem(path)
        or _find_damage(path, PICTURES.min_side_px)
        for path in found
    }
    usable = tuple(path for path, problem in damage.items() if problem is None)
    if not usable:
        raise InputError(f"{folder} holds no picture that can be used: {damage[found[0]]}")
    broken = (
        Fault(to_single_line(path.name), kind, problem) for path, problem in damage.items() if problem is not None
    )
    return usable, (*broken, *faults)


def check_picture(path: Path) -> None:
    """Raise InputError where a picture cannot be opened or is truncated."""
    if problem := _find_damage(path, 1):
        raise InputError(f"{path.parent}: {problem}")


def photos_by_facade(folder: Path) -> tuple[dict[str, Path], tuple[Fault, ...]]:
    """Return the photo of each facade by id, and a fault for each file that is missing or not read.

    The id is the file name without suffix. Truncated photos are included: their facade fails when it is processed.

    Raises
    ------
    InputError
        Where two files name one facade, or there is no picture.
    """
    photos: dict[str, Path] = {}
    found, unread = _list_pictures(folder, "photo")
    faults = []
    for path in found:
        if problem := _name_problem(path):
            raise InputError(f"{folder}: {problem}")
        facade = normal_form(path.stem)
        if facade in photos:
            raise InputError(f"{photos[facade]} and {path.name} both name facade {facade}; remove one")
        if problem := _missing_file_problem(path) or _read_problem(path):
            faults.append(Fault(path.name, "photo", problem))
        else:
            photos[facade] = path
    return photos, (*faults, *unread)


def find_facade_photo(photos: Mapping[str, Path], facade: str) -> Path | None:
    """Return the photo of a facade by its id, which may not be the name of a file; None without one."""
    return photos.get(facade, photos.get(safe_file_stem(facade)))


def _list_pictures(folder: Path, kind: str, *, with_subfolders: bool = False) -> tuple[list[Path], list[Fault]]:
    """Return the pictures of a folder, and a fault for each file that is neither read nor a companion."""
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder; give the folder that holds the pictures")
    inside = list(iterate_files(folder, with_subfolders=with_subfolders))
    found = [path for path in inside if is_picture_name(path.name) and not path.is_dir()]
    faults = [
        Fault(to_single_line(path.name), kind, to_single_line(reason))
        for path in inside
        if (reason := unread_reason(path))
    ]
    if not found:
        raise InputError(f"{folder} holds no pictures; {_remedy_without_pictures(folder, faults)}")
    return found, faults


def iterate_files(folder: Path, *, with_subfolders: bool = False) -> Iterator[Path]:
    """Yield what a folder holds by name, without what other programs leave; folders in it with their files instead."""
    for path in sorted(folder.iterdir(), key=lambda path: path.name):
        if is_system_file(path.name):
            continue
        if with_subfolders and path.is_dir() and not path.is_symlink():
            yield from iterate_files(path, with_subfolders=True)
        else:
            yield path


def _remedy_without_pictures(folder: Path, faults: list[Fault]) -> str:
    near = [folder.parent] if any(is_picture_name(path.name) for path in folder.parent.iterdir()) else []
    if near := [*near, *(folder / fault.id for fault in faults if (folder / fault.id).is_dir())]:
        return f"did you mean {near[0]}?"
    return faults[0].reason if faults else f"put {', '.join(IMAGE_SUFFIXES[:4])} files there"


def _name_problem(path: Path) -> str | None:
    """Return the reason why a file name cannot be reported; None for a usable one."""
    name = to_single_line(path.name)
    return None if name == path.name else f"{name}: its name holds what is no letter, such as a line break; rename it"


def _missing_file_problem(path: Path) -> str | None:
    """Return the reason why a name leads to no file, such as a broken link; None where it does."""
    if path.is_file():
        return None
    return f"{path.name} leads to no file; mend what it links to, or remove it"


def _read_problem(path: Path) -> str | None:
    """Return the reason why the bytes of a picture, or of its label map, cannot be read; the digest needs all of them."""
    for part in picture_and_label_paths(path):
        try:
            file_digest(part)
        except OSError as error:
            if not is_unreadable_file(error):
                raise
            return unreadable_message(part, error)
    return None


def label_map_path(picture: Path) -> Path | None:
    """Return the label map NAME.labels.png of a picture; None without one."""
    labels = picture.with_name(f"{picture.stem}{LABEL_MAP_SUFFIX}")
    return labels if labels.is_file() else None


def picture_and_label_paths(picture: Path) -> list[Path]:
    """Return a picture, and its label map if there is one."""
    labels = label_map_path(picture)
    return [picture] if labels is None else [picture, labels]


def _find_damage(path: Path, min_side: int) -> str | None:
    """Return the reason why a picture is unusable, without decoding, which would dominate the reading time."""
    try:
        with open_picture(path) as image:
            layout, (width, height) = image.format, image.size
        check = {"JPEG": _is_complete_jpeg, "MPO": _is_complete_jpeg, "PNG": _is_complete_png}.get(str(layout))
        with open_regular(path) as file:
            whole = check is None or check(file)
    except InputError as error:
        return str(error)
    if min(width, height) < min_side:
        return f"{path.name} is {width} x {height} pixels, and {min_side} a side are the least; give a larger picture"
    return None if whole else f"{path.name} is cut off; {REMEDY}"


def _is_complete_png(file: BufferedReader) -> bool:
    file.seek(max(0, file.seek(0, os.SEEK_END) - 4096))
    return b"IEND" in file.read()


def _is_complete_jpeg(file: BufferedReader) -> bool:
    """Return True where an end marker follows the first scan; earlier segments may hold a thumbnail with its own."""
    file.seek(2)
    while len(marker := file.read(2)) == 2 and marker[0] == 0xFF:
        if marker[1] == _START_OF_SCAN:
            return _contains(file, _END_OF_IMAGE)
        if marker[1] == 0xFF:  # fill byte
            file.seek(-1, os.SEEK_CUR)
        elif len(length := file.read(2)) == 2:
            file.seek(int.from_bytes(length, "big") - 2, os.SEEK_CUR)
    return False


def _contains(file: BufferedReader, wanted: bytes) -> bool:
    """Return True where the rest of a file contains some bytes; it is not mapped, since a broken disk would end the process."""
    last = b""
    while chunk := file.read(_CHUNK_BYTES):
        if wanted in last + chunk:
            return True
        last = chunk[1 - len(wanted) :]
    return False
