"""Where a run lies: a folder of this machine, or one in a bucket. What publishing asks of either is here."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import uuid
from pathlib import Path
from typing import TypeAlias, TypeVar

from catalogs.published import objects
from catalogs.published.s3 import S3Folder

Folder: TypeAlias = Path | S3Folder
F = TypeVar("F", bound=Folder)


def put(path: Folder, data: bytes) -> None:
    """Write a file in one step: a reader sees the old one or the new one."""
    if isinstance(path, S3Folder):
        objects.put(path.path, data)
        return
    temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex}.tmp")
    try:
        temporary.write_bytes(data)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def sizes_in(folder: Folder) -> dict[str, int]:
    """The files below a folder, by their paths in it, with their sizes in bytes; none where it is not there."""
    if isinstance(folder, S3Folder):
        return folder.sizes()
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.stat().st_size for path in files}


def at(folder: F, name: str) -> F:
    """A file below a folder, by its path in it."""
    for part in name.split("/"):
        folder = folder / part  # type: ignore[assignment]
    return folder


def remove(path: Folder) -> None:
    """Remove a file, or a folder with all that is in it."""
    if isinstance(path, S3Folder):
        path.remove()
        path.unlink()
    elif path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def local_side(place: Folder) -> Path:
    """The folder of this machine in which a run has what no other machine asks for: log, the server's records, what is being
    written. Of a bucket's it lies in the user's cache ($XDG_CACHE_HOME)."""
    if isinstance(place, Path):
        return place
    caches = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    name = re.sub(r"[^A-Za-z0-9.-]+", "-", place.path).strip("-")[-60:]
    return caches / "streetloom" / "runs" / f"{name}-{hashlib.blake2b(place.path.encode(), digest_size=4).hexdigest()}"
