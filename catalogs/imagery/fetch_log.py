"""Folder of fetched pictures: its log, one JSON line per picture, and its poses file."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock

from catalogs.crs import LONLAT
from catalogs.features import safe_file_stem
from catalogs.imagery.remote_panorama import RemotePanorama
from catalogs.readers.json_text import parse_json_object
from facade_core.core.errors import InputError
from facade_core.core.regular_files import read_regular

FETCH_LOG_NAME = "fetched.jsonl"
POSES_NAME = "poses.json"
# Folder of incomplete and unchecked downloads.
PARTIAL_FOLDER = ".arriving"


@dataclass(frozen=True, slots=True)
class FetchedPicture:
    """Picture that was fetched, as its service describes it.

    The attributes are the keys of a line of the log. Folders of pictures outlive versions of the code: on a rename of an
    attribute its key stays as an alias.

    Attributes
    ----------
    source, id : service, and id there.
    file : name of the file; empty if the picture was rejected or is a duplicate.
    sha256, bytes : digest and size of the file.
    lon, lat, z : degrees (WGS 84), metres.
    heading, pitch, roll : degrees, heading from true north.
    captured : day, such as "2024-05-17".
    refused : why the picture cannot be used, None if it can.
    """

    source: str
    id: str
    file: str
    sha256: str
    bytes: int
    lon: float
    lat: float
    heading: float
    z: float | None = None
    pitch: float = 0.0
    roll: float = 0.0
    captured: str | None = None
    author: str | None = None
    licence: str | None = None
    licence_url: str | None = None
    refused: str | None = None


# Keys of a picture in the poses file: its pose, which a block reads, and its author and licence.
POSES_KEYS = (
    "lon",
    "lat",
    "z",
    "heading",
    "pitch",
    "roll",
    "captured",
    "author",
    "licence",
    "licence_url",
    "source",
    "id",
    "sha256",
)


@dataclass
class FetchLog:
    """Log of the pictures in a folder, by source and id; the later of two lines of one picture wins."""

    folder: Path
    pictures: dict[tuple[str, str], FetchedPicture]
    _lock: Lock = field(default_factory=Lock)

    def find_picture(self, source: str, identifier: str) -> FetchedPicture | None:
        """Return a picture whose file is present at its logged size, or a rejected one; otherwise None."""
        found = self.pictures.get((source, identifier))
        if found is None or found.refused:
            return found
        try:
            return found if (self.folder / found.file).stat().st_size == found.bytes else None
        except OSError:
            return None

    def append(self, picture: FetchedPicture) -> None:
        """Append a line, flushed to disk before this returns."""
        line = json.dumps(_picture_values(picture, picture.__dataclass_fields__), ensure_ascii=False)
        with self._lock:
            with (self.folder / FETCH_LOG_NAME).open("a", encoding="utf-8") as file:
                file.write(f"{line}\n")
                file.flush()
                os.fsync(file.fileno())
            self.pictures[picture.source, picture.id] = picture

    def choose_stem(self, source: str, offer: RemotePanorama) -> str:
        """Return the file stem of a picture: its id, made safe and distinct from other sources'."""
        others = {Path(one.file).stem for one in self.pictures.values() if one.source != source}
        stem = safe_file_stem(offer.id)
        return stem if stem not in others else safe_file_stem(f"{source} {offer.id}")

    def write_poses(self) -> Path:
        """Write the poses file of the pictures that are present, atomically."""
        there = sorted((one for one in self.pictures.values() if not one.refused), key=lambda one: one.file)
        poses = {one.file: _picture_values(one, POSES_KEYS) for one in there if (self.folder / one.file).is_file()}
        path = self.folder / POSES_NAME
        text = json.dumps({"crs": LONLAT, "poses": poses}, ensure_ascii=False, indent=1)
        temporary = path.with_name(f".{POSES_NAME}.tmp")
        temporary.write_text(f"{text}\n", encoding="utf-8")
        os.replace(temporary, path)
        return path


def _picture_values(picture: FetchedPicture, keys: Iterable[str]) -> dict[str, object]:
    """Return the values of a picture by key; a value that is None has no key."""
    return {key: value for key in keys if (value := getattr(picture, key)) is not None}


def has_fetch_log(folder: Path) -> bool:
    """Return whether a folder has a fetch log."""
    return (folder / FETCH_LOG_NAME).is_file()


def read_fetch_log(folder: Path) -> FetchLog:
    """Read the log of a folder, or start one; an incomplete last line is dropped.

    Raises
    ------
    InputError : the folder holds other files, or a line is invalid.
    """
    path = folder / FETCH_LOG_NAME
    folder.mkdir(parents=True, exist_ok=True)
    if not path.is_file():
        if any(folder.iterdir()):
            raise InputError(
                f"{folder} holds files that were not fetched; name a new folder with --to, or fetch from it"
            )
        path.touch()
    text = read_regular(path)
    whole = text[: text.rfind(b"\n") + 1]
    if len(whole) < len(text):
        os.truncate(path, len(whole))
    return FetchLog(folder, {(one.source, one.id): one for one in _parse_lines(path, whole)})


def _parse_lines(path: Path, text: bytes) -> Iterator[FetchedPicture]:
    from pydantic import TypeAdapter

    lines = TypeAdapter(FetchedPicture)
    for number, line in enumerate(text.splitlines(), 1):
        try:
            kept = lines.validate_python(parse_json_object(line, f"{path}: line {number}"))
        except (ValueError, AttributeError) as error:
            raise InputError(f"{path}: line {number} is no account of a picture; remove that line") from error
        if kept.file != Path(kept.file).name:
            raise InputError(f"{path}: line {number} names {kept.file[:60]!r}, which lies elsewhere; remove that line")
        yield kept
