"""Targets of exports: their marker file, and whether a new export may replace what is there.

A folder has a marker with the digests of its files. An export inside an export, such as a block of a city, has a marker
of its own, and counts as that one file in the outer marker. A GeoPackage that is a single file carries its digest itself.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from catalogs.published.folders import Folder
from catalogs.published.geopackage_digest import compute_geopackage_digest, read_geopackage_stamp
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject
from facade_core.core.regular_files import open_regular, read_regular
from tasks.export.registry import FILE_SUFFIXES, FORMATS

if TYPE_CHECKING:
    from tasks.publish.published_run import PublishedBlock

# Sources of an export and digests of its files.
MARKER = "export.json"
# Name of the marker in formats whose tools read every .json file.
HIDDEN_MARKER = ".export.json"
# Suffix of an export that is being replaced.
REPLACED = ".old.tmp"
# Suffix of the file in which GDAL keeps what it found out about another.
AUXILIARY = ".aux.xml"


@dataclass(frozen=True)
class ExportResult:
    """Finished export.

    Attributes
    ----------
    path : its folder, or its single file.
    files : files to open first.
    notes : remarks for the user, one line each.
    """

    path: Folder
    files: tuple[Folder, ...]
    notes: tuple[str, ...]


def marker_name(format: str) -> str:
    """Return the name of an export's marker file, which lists its sources and digests."""
    return HIDDEN_MARKER if FORMATS[format].hides_marker else MARKER


def export_folder_name(format: str, options: Mapping[str, object]) -> str:
    """Return the name of an export's default folder; tiles of another CRS must not replace those that a city refers to."""
    return f"{format}-{options['crs']}" if "crs" in options else format


def read_marker(folder: Path) -> JsonObject | None:
    """Read the marker of an export; None if the folder has none that can be read."""
    hidden = folder / HIDDEN_MARKER
    try:
        about = json.loads(read_regular(hidden if hidden.is_file() else folder / MARKER))
        return about if isinstance(about["digests"], dict) and isinstance(about["format"], str) else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def write_block_marker(
    folder: Path,
    results: PublishedBlock,
    format: str,
    key: str,
    files: Sequence[str],
    notes: Sequence[str],
    facts: JsonObject | None = None,
) -> None:
    """Write the marker of a block's export, when all its files are there.

    Parameters
    ----------
    folder : folder of the export.
    results : published results of the block.
    format : format of the export.
    key : digest of what it is made of.
    files : files to open first.
    notes : remarks for the user.
    facts : what the export of a city must know of the block.
    """
    about: JsonObject = {
        "format": format,
        "block": results.block,
        "snapshot": results.snapshot.id,
        "crs": results.crs,
        "key": key,
        "attribution": results.attribution.to_json(),
        **({"facts": facts} if facts else {}),
        "notes": list(notes),
        "files": list(files),
        "digests": file_digests(folder),
    }
    (folder / marker_name(format)).write_text(json.dumps(about, indent=1) + "\n")


def check_target(target: Path, format: str, as_file: bool) -> None:
    """Raise InputError unless an export may be written to a target: nothing, or an earlier export that nobody changed.

    Parameters
    ----------
    target : absolute path.
    format : format of the new export.
    as_file : the export is one file, a GeoPackage.
    """
    if as_file:
        _check_target_file(target)
    elif target.is_dir():
        if any(target.iterdir()) and (why := _foreign_content(target, format)):
            raise InputError(f"{target}: {why}; name a new or empty folder with --to")
    elif target.exists():
        raise InputError(f"{target}: is a file, and an export of {format} is a folder; name a folder with --to")
    elif target.suffix.lower() in FILE_SUFFIXES:
        if FORMATS[format].can_be_file:
            remedy = f"such as --to {target.stem}{FORMATS[format].suffix}, or a folder"
            raise InputError(f"--to {target.name}: {format} goes into a file, {remedy}")
        files = " and ".join(entry.name for entry in FORMATS.values() if entry.can_be_file)
        raise InputError(
            f"--to {target.name}: an export of {format} is a folder (only {files} can be one file); name one, without "
            f"{target.suffix}"
        )


def replace_file(file: Path, target: Path) -> None:
    """Move a file to its target, over an earlier one, and remove what GDAL keeps of that."""
    os.replace(file, target)
    target.with_name(target.name + AUXILIARY).unlink(missing_ok=True)


def replace_folder(folder: Path, target: Path) -> None:
    """Move a folder to its target, over an earlier one; a kill never leaves half of the earlier one in its place."""
    replaced = folder.with_name(f"{folder.name}{REPLACED}")
    if target.exists():
        os.replace(target, replaced)
    os.replace(folder, target)
    shutil.rmtree(replaced, ignore_errors=True)


def _check_target_file(target: Path) -> None:
    remedy = "remove it, or name a new file with --to"
    if not (target.exists() or target.is_symlink()):
        return
    try:
        stamp = read_geopackage_stamp(target)
    except (InputError, OSError):
        stamp = None
    if stamp is None:
        raise InputError(f"{target}: is there already, and is no GeoPackage that this program exported; {remedy}")
    if stamp.digest != compute_geopackage_digest(target):
        raise InputError(f"{target}: was changed since the export; {remedy}")
    for suffix in ("-wal", "-journal"):
        if (beside := target.with_name(target.name + suffix)).exists():
            raise InputError(f"{target}: another program has it open ({beside.name}); close it there, and export again")


def _foreign_content(folder: Path, format: str) -> str | None:
    """Explain why a folder must not be replaced; None if it is an unchanged export of the format."""
    about = read_marker(folder)
    if about is None:
        return "holds other files than an export"
    if about["format"] != format:
        return f"holds an export of {about['format']}"
    touched = find_changed_file(folder, about)
    return f"{touched} was added or changed since the export" if touched else None


def find_changed_file(folder: Path, about: JsonObject) -> str | None:
    """Return the first file of an export that was added, changed or removed since; None if there is none.

    Parameters
    ----------
    folder : folder of the export.
    about : its marker.
    """
    digests: dict[str, str] = about["digests"]
    now = file_digests(folder)
    touched = sorted(name for name in digests.keys() | now.keys() if digests.get(name) != now.get(name))
    if touched:
        return touched[0]
    for name in sorted(digests):
        if "/" in name and Path(name).name in (MARKER, HIDDEN_MARKER):
            inner = folder / Path(name).parent
            if (nested := read_marker(inner)) and (changed := find_changed_file(inner, nested)):
                return f"{Path(name).parent.as_posix()}/{changed}"
    return None


def file_digests(folder: Path) -> dict[str, str]:
    """Compute a digest of every file below a folder except the marker, by relative path.

    Of an export inside it, only the marker counts. Of a GeoPackage the content counts: a viewer changes its header.
    NAME.aux.xml beside a file does not count: GDAL writes it when it reads the file.
    """
    return {path.relative_to(folder).as_posix(): _file_digest(path) for path in _list_files(folder)}


def _list_files(folder: Path) -> Iterator[Path]:
    waiting = [folder]
    while waiting:
        parent = waiting.pop()
        for path in sorted(parent.iterdir()):
            if path.is_file():
                is_marker = parent == folder and path.name in (MARKER, HIDDEN_MARKER)
                if not (
                    is_marker
                    or (path.name.endswith(AUXILIARY) and path.with_name(path.name[: -len(AUXILIARY)]).exists())
                ):
                    yield path
            elif path.is_dir():
                marker = next((one for one in (path / MARKER, path / HIDDEN_MARKER) if one.is_file()), None)
                if marker is None:
                    waiting.append(path)
                else:
                    yield marker


def _file_digest(path: Path) -> str:
    if path.suffix.lower() == ".gpkg":
        try:
            return compute_geopackage_digest(path)
        except InputError:  # no GeoPackage any more
            pass
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
