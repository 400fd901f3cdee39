"""Copy of a run into a bucket; concurrent readers see the old snapshot or the new one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from catalogs.published import object_store
from catalogs.published.s3 import S3Path

# References to other files; they are copied last.
_REFERENCES = "store/refs"
_POINTERS = ("current", "catalog.json")
# Suffixes of files that are rewritten under the same name.
_REWRITTEN = (".json", ".yaml")


def put_object(folder: S3Path, name: str, data: bytes) -> None:
    """Write an object of a folder in a bucket; raises the errors of `object_store`."""
    object_store.upload_object(f"{folder.path}/{name}", data)


def copy_run_to_bucket(
    run: Path,
    target: S3Path,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
    put: Callable[[S3Path, str, bytes], None] = put_object,
) -> int:
    """Copy the store and all published files of a run, and return the number of files sent.

    Present files are skipped: chunks and pictures are never written twice under one name. The store's references follow
    its data, then `current`, and catalog.json last. Nothing in the bucket is removed. The run must not go on meanwhile.

    Parameters
    ----------
    on_progress : called with the numbers of files done and in total.
    put : writes an object of a folder in a bucket.

    Raises
    ------
    InputError : the bucket rejects a file.
    """
    references = {path: path.read_bytes() for path in _visible_files(run / _REFERENCES)}
    data = [
        path for path in (*_visible_files(run / "store"), *_visible_files(run / "published")) if path not in references
    ]
    sizes = target.sizes()
    due = [path for path in data if _needs_copy(path, sizes.get(path.relative_to(run).as_posix()))]
    with ThreadPoolExecutor(object_store.MAX_CONCURRENT_REQUESTS) as threads:
        sent = threads.map(lambda path: put(target, path.relative_to(run).as_posix(), path.read_bytes()), due)
        for number, _ in enumerate(sent, 1):
            on_progress(number, len(due))
        list(threads.map(lambda path: put(target, path.relative_to(run).as_posix(), references[path]), references))
    for name in _POINTERS:
        put(target, name, (run / name).read_bytes())
    return len(due) + len(references) + len(_POINTERS)


def copy_catalog_to_bucket(folder: Path, target: S3Path) -> None:
    """Copy folder/catalog.json of a folder of runs."""
    put_object(target, "catalog.json", (folder / "catalog.json").read_bytes())


def _visible_files(folder: Path) -> Iterator[Path]:
    """Yield the files below a folder, except partial ones."""
    for path in sorted(folder.rglob("*")):
        if path.is_file() and not any(part.startswith(".") for part in path.relative_to(folder).parts):
            yield path


def _needs_copy(path: Path, size: int | None) -> bool:
    return size != path.stat().st_size or path.suffix in _REWRITTEN
