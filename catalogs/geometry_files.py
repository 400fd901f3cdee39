"""Which reader reads which geometry file. A new format is one function and one row here."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

from catalogs import osm
from catalogs.features import Centrelines, Footprints
from facade_core.errors import InputError

FOOTPRINT_READERS: Mapping[str, Callable[[Path], Footprints]] = {".pbf": osm.read_footprints}
CENTRELINE_READERS: Mapping[str, Callable[[Path], Centrelines]] = {".pbf": osm.read_centrelines}

T = TypeVar("T")


def read_footprints(path: Path) -> Footprints:
    """Read building outlines; the suffix picks the reader. Raises InputError for an unknown suffix or a broken file."""
    return _reader(path, FOOTPRINT_READERS)(path)


def read_centrelines(path: Path) -> Centrelines:
    """Read street centrelines; the suffix picks the reader. Raises InputError for an unknown suffix or a broken file."""
    return _reader(path, CENTRELINE_READERS)(path)


def _reader(path: Path, readers: Mapping[str, Callable[[Path], T]]) -> Callable[[Path], T]:
    reader = readers.get(path.suffix.lower())
    if reader is None:
        supported = ", ".join(sorted(readers))
        raise InputError(f"{path}: files of type {path.suffix or '(none)'} are not read; supported: {supported}")
    return reader
