"""What was published is still there: every file's size and digest, written with the snapshot it is of."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

from catalogs.published.folders import Folder, at, put, sizes_in

FILES = "files.json"
# What queries and summaries are read from is compared by content each time, all else by size.
READ = ("items.parquet", "summary.json")

# A file's size in bytes, and its digest.
Listed: TypeAlias = tuple[int, str]


def write_files(
    folder: Path,
    predecessor: str | None,
    tags: Iterable[str],
    *,
    made: Mapping[str, str] | None = None,
    known: Mapping[str, Listed] | None = None,
    failed: Mapping[str, str] | None = None,
) -> None:
    """Write the list of all files in the folder of a snapshot that is complete, which snapshot was published before it, and
    which tags the store has of the streets in it.

    made: of some files, what they are made of, so that a later snapshot may link them; known: size and digest of some, which
    are not read. failed: what could not be published, and why.
    """
    paths = {path.relative_to(folder).as_posix(): path for path in sorted(folder.rglob("*")) if path.is_file()}
    listed = {
        name: list((known or {}).get(name) or (path.stat().st_size, digest_of(path))) for name, path in paths.items()
    }
    held: dict[str, Any] = {"predecessor": predecessor, "tags": sorted(tags), "files": listed}
    _write(folder, held | {"made": dict(made or {}), "failed": dict(failed or {})})


def amiss(folder: Folder, *, thorough: bool = False) -> str | None:
    """What is wrong with a published folder, such as "block.glb is missing"; None where nothing is.

    thorough: every file is read. Only the snapshot that is current is as it was written: older ones are marked as such.
    """
    held = listed_in(folder)
    if held is None:
        return f"{FILES} is missing or cannot be read"
    for what, why in held["failed"].items():
        return f"{what} could not be published: {why}"
    there = sizes_in(folder)
    for name, (size, digest) in held["files"].items():
        if name not in there:
            return f"{name} is missing"
        if there[name] != size:
            return f"{name} has {there[name]} bytes of {size}"
        try:
            if (thorough or name in READ) and digest_of(at(folder, name)) != digest:
                return f"{name} is not as it was written"
        except OSError as error:
            return f"{name}: {error.strerror}"
    return None


def note_changed(folder: Folder, names: Iterable[str]) -> None:
    """Note of files in a published folder, by their paths in it, that they were changed since; the others are as they were."""
    held = listed_in(folder)
    if held is None:
        return
    there = sizes_in(folder)
    for name in names:
        held["files"][name] = [there[name], digest_of(at(folder, name))]
    _write(folder, held)


def tags_of(folder: Folder) -> list[str]:
    """The tags of the streets in a published snapshot, as its folder says."""
    held = listed_in(folder)
    return held["tags"] if held else []


def predecessor_of(folder: Folder) -> str | None:
    """The snapshot that was published before that of a folder; None where there was none, or the folder does not say."""
    held = listed_in(folder)
    return held["predecessor"] if held else None


def listed_in(folder: Folder) -> dict[str, Any] | None:
    """What the list in a published folder says, None where it cannot be read: `files` (path -> Listed) among it."""
    try:
        held = json.loads((folder / FILES).read_text())
        return {
            "predecessor": held["predecessor"],
            "tags": list(map(str, held["tags"])),
            "files": {str(name): (int(size), str(digest)) for name, (size, digest) in held["files"].items()},
            # snapshots from before parts of them could fail have neither
            **{name: {str(k): str(v) for k, v in held.get(name, {}).items()} for name in ("made", "failed")},
        }
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def _write(folder: Folder, held: dict[str, Any]) -> None:
    put(folder / FILES, json.dumps(held, indent=1).encode())


def digest_of(path: Folder) -> str:
    """Digest of a file, hexadecimal."""
    if not isinstance(path, Path):
        return hashlib.blake2b(path.read_bytes(), digest_size=8).hexdigest()
    with path.open("rb") as file:
        return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=8)).hexdigest()
