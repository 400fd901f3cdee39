"""What was published is still there: every file's size and digest, written with the snapshot it is of."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

FILES = "files.json"
# What queries and summaries are read from is compared by content each time, all else by size.
READ = ("items.parquet", "summary.json")


def write_files(folder: Path, predecessor: str | None, tags: Iterable[str]) -> None:
    """Write the list of all files in the folder of a snapshot that is complete, which snapshot was published before it, and
    which tags the store has of the streets in it."""
    listed = {
        path.relative_to(folder).as_posix(): [path.stat().st_size, _digest(path)]
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
    _write(folder, {"predecessor": predecessor, "tags": sorted(tags), "files": listed})


def amiss(folder: Path, *, thorough: bool = False) -> str | None:
    """What is wrong with a published folder, such as "block.glb is missing"; None where nothing is.

    thorough: every file is read. Only the snapshot that is current is as it was written: older ones are marked as such.
    """
    held = _listed(folder)
    if held is None:
        return f"{FILES} is missing or cannot be read"
    for name, (size, digest) in held["files"].items():
        path = folder / name
        try:
            if path.stat().st_size != size:
                return f"{name} has {path.stat().st_size} bytes of {size}"
            if (thorough or name in READ) and _digest(path) != digest:
                return f"{name} is not as it was written"
        except OSError as error:
            return f"{name} is missing" if isinstance(error, FileNotFoundError) else f"{name}: {error.strerror}"
    return None


def note_changed(folder: Path, paths: Iterable[Path]) -> None:
    """Note of files in a published folder that they were changed since; the others are as they were."""
    held = _listed(folder)
    if held is None:
        return
    for path in paths:
        held["files"][path.relative_to(folder).as_posix()] = [path.stat().st_size, _digest(path)]
    _write(folder, held)


def tags_of(folder: Path) -> list[str]:
    """The tags of the streets in a published snapshot, as its folder says."""
    held = _listed(folder)
    return held["tags"] if held else []


def predecessor_of(folder: Path) -> str | None:
    """The snapshot that was published before that of a folder; None where there was none, or the folder does not say."""
    held = _listed(folder)
    return held["predecessor"] if held else None


def _listed(folder: Path) -> dict[str, Any] | None:
    try:
        held = json.loads((folder / FILES).read_text())
        return {
            "predecessor": held["predecessor"],
            "tags": list(map(str, held["tags"])),
            "files": {str(name): (int(size), str(digest)) for name, (size, digest) in held["files"].items()},
        }
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def _write(folder: Path, held: dict[str, Any]) -> None:
    temporary = folder / f".{FILES}.tmp"
    temporary.write_text(json.dumps(held, indent=1))
    os.replace(temporary, folder / FILES)


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=8)).hexdigest()
