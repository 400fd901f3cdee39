"""Pictures to harvest: files and folders, each picture once, with its author and licence where these are known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from catalogs.features import Fault, safe_file_stem
from catalogs.file_digest import file_digest
from catalogs.imagery.fetch_log import has_fetch_log, read_fetch_log
from catalogs.readers.pictures.decoding import open_picture
from catalogs.readers.pictures.folders import check_picture, list_images
from facade_core.core.errors import InputError

_EXIF_ARTIST = 315
_EXIF_COPYRIGHT = 33432


@dataclass(frozen=True)
class SourcePicture:
    """Picture to harvest.

    Attributes
    ----------
    path : file.
    name : name of its exemplars, unique among the pictures.
    digest : sha256 of the file.
    source, author, licence, licence_url : where it is from and what it may be used for; None if unknown.
    """

    path: Path
    name: str
    digest: str
    source: str | None = None
    author: str | None = None
    licence: str | None = None
    licence_url: str | None = None


def list_source_pictures(places: Sequence[Path], licence: str | None = None) -> tuple[list[SourcePicture], list[Fault]]:
    """List the pictures of files and folders, and a fault for each file that cannot be read or is there twice.

    Parameters
    ----------
    places : files, and folders of pictures.
    licence : licence of pictures that state none.

    Raises
    ------
    InputError : a folder holds no picture, or a named file is none.
    """
    paths: list[Path] = []
    faults: list[Fault] = []
    for place in places:
        if place.is_dir():
            found, unread = list_images(place, "picture")
            paths += found
            faults += unread
        else:
            check_picture(place)
            paths.append(place)
    logs = {folder: _read_rights(folder) for folder in {path.parent for path in paths}}
    pictures: dict[str, SourcePicture] = {}
    names: set[str] = set()
    for path in paths:
        digest = file_digest(path)
        if digest in pictures:
            faults.append(
                Fault(path.name, "picture", f"{path.name} is the same picture as {pictures[digest].path.name}")
            )
            continue
        name = safe_file_stem(path.stem)
        if name in names:
            name = f"{name}-{digest[:8]}"
        names.add(name)
        rights = logs[path.parent].get(path.name) or _read_exif_rights(path)
        pictures[digest] = SourcePicture(
            path, name, digest, rights.source, rights.author, rights.licence or licence, rights.licence_url
        )
    return list(pictures.values()), faults


@dataclass(frozen=True)
class _Rights:
    source: str | None = None
    author: str | None = None
    licence: str | None = None
    licence_url: str | None = None


def _read_rights(folder: Path) -> dict[str, _Rights]:
    """Read author and licence of the pictures of a folder that were fetched from a service, by file."""
    if not has_fetch_log(folder):
        return {}
    pictures = read_fetch_log(folder).pictures.values()
    return {one.file: _Rights(f"{one.source} {one.id}", one.author, one.licence, one.licence_url) for one in pictures}


def _read_exif_rights(path: Path) -> _Rights:
    """Read the author and licence that the EXIF of a picture states."""
    try:
        with open_picture(path) as image:
            tags = image.getexif()
            artist, copyright_text = tags.get(_EXIF_ARTIST), tags.get(_EXIF_COPYRIGHT)
    except InputError:
        raise
    except Exception:  # damaged metadata raises errors of any class
        return _Rights()
    author, licence = (
        " ".join(text.split()) or None if isinstance(text, str) else None for text in (artist, copyright_text)
    )
    return _Rights(author=author, licence=licence)
