"""What a block file's data come from, and under which licence where that is known."""

from __future__ import annotations

import hashlib
from pathlib import Path

from catalogs.block.keys import check_keys
from catalogs.block.paths import FOLDERS, named_paths
from catalogs.block.yaml_files import read_yaml
from catalogs.examples.sources import SOURCES
from catalogs.stac.facts import SourceFact

OPENSTREETMAP = "OpenStreetMap contributors, ODbL 1.0"


def sources_of(block_file: Path) -> tuple[SourceFact, ...]:
    """The files and folders that a block file names. The licence of a file is known where it is one that `streetloom fetch`
    brings, by its checksum, or an extract of OpenStreetMap. None of them where the block file cannot be read any more."""
    try:
        paths = named_paths(check_keys(read_yaml(block_file)), block_file)
        return tuple(
            SourceFact(key, path.name, None if key in FOLDERS else _licence(path))
            for key, found in paths.items()
            for path in found
        )
    except (ValueError, OSError):  # it was read when the run began, and may be gone by its end
        return ()


def _licence(path: Path) -> str | None:
    if path.suffix == ".pbf":
        return OPENSTREETMAP
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return next((s.licence for s in SOURCES.values() if any(f.sha256 == digest for f in s.files)), None)
