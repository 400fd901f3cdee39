"""Where a run lies: a folder of this machine, or one in a bucket. What publishing asks of either is here."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import uuid
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeAlias, TypeVar

from catalogs.published import object_store
from catalogs.published.s3 import S3Folder

Folder: TypeAlias = Path | S3Folder
F = TypeVar("F", bound=Folder)
T = TypeVar("T")
R = TypeVar("R")


def each(act: Callable[[T], R], items: Iterable[T], place: Folder) -> list[R]:
    """What comes of each item, in their order; what asks a bucket is under way many at a time."""
    if isinstance(place, Path):
        return list(map(act, items))
    with ThreadPoolExecutor(object_store.AT_ONCE) as threads:
        return list(threads.map(act, items))


def put(path: Folder, data: bytes) -> None:
    """Write a file in one step: a reader sees the old one or the new one."""
    if isinstance(path, S3Folder):
        object_store.put(path.path, data)
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


def move(folder: F, to: F) -> None:
    """Move a folder, over what is there. In a bucket object by object, the pointer that readers follow first to go."""
    if isinstance(folder, Path) and isinstance(to, Path):
        shutil.rmtree(to, ignore_errors=True)
        to.parent.mkdir(parents=True, exist_ok=True)
        os.replace(folder, to)
    elif isinstance(folder, S3Folder) and isinstance(to, S3Folder):
        to.remove()
        each(lambda name: object_store.copy(f"{folder.path}/{name}", f"{to.path}/{name}"), folder.sizes(), folder)
        (folder / "current").unlink()
        folder.remove()


def size_of(path: Folder) -> int | None:
    """The bytes of a file; None where there is none."""
    if isinstance(path, S3Folder):
        return path.size()
    return path.stat().st_size if path.is_file() else None


def local_side(place: Folder) -> Path:
    """The folder of this machine in which a run has what no other machine asks for: log, the server's records, what is being
    written. Of a bucket's it lies in the user's cache ($XDG_CACHE_HOME)."""
    if isinstance(place, Path):
        return place
    caches = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    name = re.sub(r"[^A-Za-z0-9.-]+", "-", place.path).strip("-")[-60:]
    return caches / "streetloom" / "runs" / f"{name}-{hashlib.blake2b(place.path.encode(), digest_size=4).hexdigest()}"
