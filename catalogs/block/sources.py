"""Sources of a block's data and their licences."""

from __future__ import annotations

import hashlib
from collections import Counter
from pathlib import Path

from catalogs.block.declared_keys import PathKind
from catalogs.block.key_faults import read_block_settings
from catalogs.block.paths import path_keys, resolve_paths
from catalogs.examples.painted_pictures import PAINTED_FOLDERS, PAINTED_LICENCE, is_painted
from catalogs.examples.sources import EXAMPLE_SOURCES
from catalogs.imagery.fetch_log import has_fetch_log, read_fetch_log
from catalogs.stac.facts import DataSourceFacts
from facade_core.core.errors import InputError
from facade_core.core.regular_files import open_regular

# Authors named per licence; poses.json in the pictures' folder names all.
MAX_NAMED_AUTHORS = 8
OPENSTREETMAP = "OpenStreetMap contributors, ODbL 1.0"


def block_data_sources(block_file: Path) -> tuple[DataSourceFacts, ...]:
    """Return the files and folders that a block file names, each with its licence if known.

    A file's licence is known if its checksum is that of an example's file, or if it is an OpenStreetMap extract. So is
    that of an unchanged folder of painted pictures. A folder of fetched pictures gives one source per licence. Returns
    nothing if the block file cannot be read any more.
    """
    try:
        kinds, paths = path_keys(), resolve_paths(read_block_settings(block_file), block_file)
        return tuple(
            DataSourceFacts(key, path.name, licence)
            for key, found in paths.items()
            for path in found
            for licence in (_picture_licences(path) if kinds[key] is PathKind.FOLDER else (_file_licence(path),))
        )
    except (ValueError, OSError, InputError):  # the file may disappear during the run
        return ()


def _file_licence(path: Path) -> str | None:
    if path.suffix == ".pbf":
        return OPENSTREETMAP
    with open_regular(path) as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return next((s.licence for s in EXAMPLE_SOURCES.values() if any(f.sha256 == digest for f in s.files)), None)


def _picture_licences(folder: Path) -> tuple[str | None, ...]:
    """Return authors and licence of fetched pictures, one text per licence, or of painted ones; (None,) for others."""
    if not has_fetch_log(folder):
        return (PAINTED_LICENCE if _is_painted_folder(folder) else None,)
    authors: dict[str, list[str]] = {}
    for one in read_fetch_log(folder).pictures.values():
        if not one.refused:
            authors.setdefault(one.licence or "licence not stated", []).append(one.author or "author not stated")
    return tuple(f"{_most_frequent_names(names)}, {licence}" for licence, names in sorted(authors.items())) or (None,)


def _is_painted_folder(folder: Path) -> bool:
    """Return True for a folder that holds exactly the project's painted exemplars, or its painted photos."""
    files = {path.name: path for path in folder.iterdir() if path.is_file()}
    is_whole = any(files.keys() == {one.name for one in shipped.iterdir()} for shipped in PAINTED_FOLDERS)
    return is_whole and all(map(is_painted, files.values()))


def _most_frequent_names(names: list[str]) -> str:
    """Return the most frequent names, MAX_NAMED_AUTHORS at most."""
    counted = [name.replace(",", " ").replace(":", " ") for name, _ in Counter(sorted(names)).most_common()]
    more = f" and {len(counted) - MAX_NAMED_AUTHORS} others" if len(counted) > MAX_NAMED_AUTHORS else ""
    return "; ".join(counted[:MAX_NAMED_AUTHORS]) + more
