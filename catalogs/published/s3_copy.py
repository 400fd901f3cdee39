"""Copying a run into a bucket, so that who reads there meanwhile sees the old snapshot or the new one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from catalogs.published.s3 import S3Folder, filesystem, reached
from facade_core.core.errors import InputError

# Requests under way at once: they wait for the network, and for little else.
AT_ONCE = 16
# What names the rest; it arrives when the rest is there.
_REFERENCES, _POINTERS = "store/refs", ("current", "catalog.json")
# Everything else is never written twice under one name, but for these.
_REWRITTEN = (".json", ".yaml")


def put_object(place: S3Folder, name: str, data: bytes) -> None:
    """Write an object of a folder in a bucket. Raises InputError where the bucket refuses."""
    try:
        with reached(place), filesystem().open_output_stream(f"{place.path}/{name}") as stream:
            stream.write(data)
    except InputError as error:
        raise InputError(str(error).replace("cannot be reached", f"{name} cannot be written", 1)) from error


def copy_run(
    run: Path,
    target: S3Folder,
    arrived: Callable[[int, int], None] = lambda done, total: None,
    put: Callable[[S3Folder, str, bytes], None] = put_object,
) -> int:
    """Copy the store and all that is published of the run in folder `run`; returns how many files were sent.

    What is there already is not sent again: chunks and pictures are never written twice under one name. The store's
    references come after its data, then `current`, and catalog.json last. Nothing in the bucket is removed. The run must not
    go on meanwhile.

    Args:
        arrived: is told of files done and in all.
        put: writes an object of a folder in a bucket.

    Raises InputError where the bucket refuses.
    """
    references = {path: path.read_bytes() for path in _files(run / _REFERENCES)}
    data = [path for path in (*_files(run / "store"), *_files(run / "published")) if path not in references]
    sizes = _sizes(target)
    due = [path for path in data if _is_due(path, sizes.get(path.relative_to(run).as_posix()))]
    with ThreadPoolExecutor(AT_ONCE) as threads:
        sent = threads.map(lambda path: put(target, path.relative_to(run).as_posix(), path.read_bytes()), due)
        for number, _ in enumerate(sent, 1):
            arrived(number, len(due))
        list(threads.map(lambda path: put(target, path.relative_to(run).as_posix(), references[path]), references))
    for name in _POINTERS:
        put(target, name, (run / name).read_bytes())
    return len(due) + len(references) + len(_POINTERS)


def copy_catalog(folder: Path, target: S3Folder) -> None:
    """Copy folder/catalog.json, that of a folder of runs, which must be there already."""
    put_object(target, "catalog.json", (folder / "catalog.json").read_bytes())


def _files(folder: Path) -> Iterator[Path]:
    """The files below a folder, but for what is being written."""
    for path in sorted(folder.rglob("*")):
        if path.is_file() and not any(part.startswith(".") for part in path.relative_to(folder).parts):
            yield path


def _sizes(target: S3Folder) -> dict[str, int]:
    """The files below a folder in a bucket, by their paths in it, with their sizes."""
    from pyarrow.fs import FileSelector, FileType

    with reached(target):
        selector = FileSelector(target.path, allow_not_found=True, recursive=True)
        found: Iterable = filesystem().get_file_info(selector)
    return {one.path[len(target.path) + 1 :]: one.size for one in found if one.type == FileType.File}


def _is_due(path: Path, size: int | None) -> bool:
    return size != path.stat().st_size or path.suffix in _REWRITTEN
