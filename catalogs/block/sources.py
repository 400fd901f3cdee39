"""What a block file's data come from, and under which licence where that is known."""

from __future__ import annotations

import hashlib
from collections import Counter
from pathlib import Path

from catalogs.block.keys import check_keys
from catalogs.block.paths import FOLDER_KEYS, resolve_paths
from catalogs.block.yaml_files import read_yaml
from catalogs.examples.sources import EXAMPLE_SOURCES
from catalogs.imagery.fetch_log import is_fetched, read_fetch_log
from catalogs.stac.facts import SourceFact
from facade_core.core.errors import InputError

# Who took pictures of one licence are named, so many of them; poses.json beside the pictures names all.
NAMED = 8
OPENSTREETMAP = "OpenStreetMap contributors, ODbL 1.0"


def block_sources(block_file: Path) -> tuple[SourceFact, ...]:
    """The files and folders that a block file names. The licence of a file is known where it is one that `streetloom fetch`
    brings, by its checksum, or an extract of OpenStreetMap; of a folder of fetched pictures each of theirs is one.
    None of them where the block file cannot be read any more."""
    try:
        paths = resolve_paths(check_keys(read_yaml(block_file)), block_file)
        return tuple(
            SourceFact(key, path.name, licence)
            for key, found in paths.items()
            for path in found
            for licence in (_picture_licences(path) if key in FOLDER_KEYS else (_file_licence(path),))
        )
    except (ValueError, OSError, InputError):  # it was read when the run began, and may be gone by its end
        return ()


def _file_licence(path: Path) -> str | None:
    if path.suffix == ".pbf":
        return OPENSTREETMAP
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return next((s.licence for s in EXAMPLE_SOURCES.values() if any(f.sha256 == digest for f in s.files)), None)


def _picture_licences(folder: Path) -> tuple[str | None, ...]:
    """Who took the fetched pictures of a folder, and their licence, for each licence; of another folder nothing is known."""
    if not is_fetched(folder):
        return (None,)
    authors: dict[str, list[str]] = {}
    for one in read_fetch_log(folder).pictures.values():
        if not one.refused:
            authors.setdefault(one.licence or "licence not stated", []).append(one.author or "author not stated")
    return tuple(f"{_most_frequent_names(names)}, {licence}" for licence, names in sorted(authors.items())) or (None,)


def _most_frequent_names(names: list[str]) -> str:
    """The names that stand there most often, no more than NAMED."""
    counted = [name.replace(",", " ").replace(":", " ") for name, _ in Counter(sorted(names)).most_common()]
    more = f" and {len(counted) - NAMED} others" if len(counted) > NAMED else ""
    return "; ".join(counted[:NAMED]) + more
