"""Folder of a run, on this machine or in a bucket, and the file operations of publishing."""

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
from catalogs.published.s3 import S3Path
from facade_core.core.cache_folders import user_cache_folder

Folder: TypeAlias = Path | S3Path
F = TypeVar("F", bound=Folder)
T = TypeVar("T")
R = TypeVar("R")


def map_concurrently(function: Callable[[T], R], items: Iterable[T], place: Folder) -> list[R]:
    """Apply a function to items and keep their order; calls for a bucket run concurrently."""
    if isinstance(place, Path):
        return list(map(function, items))
    with ThreadPoolExecutor(object_store.MAX_CONCURRENT_REQUESTS) as threads:
        return list(threads.map(function, items))


def write_atomically(path: Folder, data: bytes) -> None:
    """Write a file atomically."""
    if isinstance(path, S3Path):
        object_store.upload_object(path.path, data)
        return
    temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex}.tmp")
    try:
        temporary.write_bytes(data)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def file_sizes(folder: Folder) -> dict[str, int]:
    """Return path -> size in bytes of the files below a folder; empty if it does not exist."""
    if isinstance(folder, S3Path):
        return folder.sizes()
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.stat().st_size for path in files}


def join_path(folder: F, name: str) -> F:
    """Return the file below a folder at a relative path."""
    for part in name.split("/"):
        folder = folder / part  # type: ignore[assignment]
    return folder


def remove_path(path: Folder) -> None:
    """Remove a file, or a folder with its contents."""
    if isinstance(path, S3Path):
        path.remove()
        path.unlink()
    elif path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def move_folder(folder: F, target: F) -> None:
    """Move a folder over another.

    In a bucket objects are copied one by one, and the pointer `current` is removed first.
    """
    if isinstance(folder, Path) and isinstance(target, Path):
        shutil.rmtree(target, ignore_errors=True)
        target.parent.mkdir(parents=True, exist_ok=True)
        os.replace(folder, target)
    elif isinstance(folder, S3Path) and isinstance(target, S3Path):
        target.remove()
        map_concurrently(
            lambda name: object_store.copy_object(f"{folder.path}/{name}", f"{target.path}/{name}"),
            folder.sizes(),
            folder,
        )
        (folder / "current").unlink()
        folder.remove()


def file_size(path: Folder) -> int | None:
    """Return the size of a file in bytes, or None if it does not exist."""
    if isinstance(path, S3Path):
        return path.size()
    return path.stat().st_size if path.is_file() else None


def local_run_folder(place: Folder) -> Path:
    """Return the folder on this machine for a run's log, server records and partial files; the run's own if local.

    For a run in a bucket it is in the user's cache, see `user_cache_folder`.
    """
    if isinstance(place, Path):
        return place
    name = re.sub(r"[^A-Za-z0-9.-]+", "-", place.path).strip("-")[-60:]
    digest = hashlib.blake2b(place.path.encode(), digest_size=4).hexdigest()
    return user_cache_folder() / "streetloom" / "runs" / f"{name}-{digest}"
