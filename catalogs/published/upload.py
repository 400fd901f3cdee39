"""Upload of a snapshot that was written on this machine to its bucket."""

from __future__ import annotations

from collections.abc import Collection
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from catalogs.published import object_store
from catalogs.published.file_list import FILE_LIST_NAME
from catalogs.published.s3 import S3Path


def upload_snapshot(written: Path, final: S3Path, earlier: S3Path | None, linked: Collection[str]) -> None:
    """Upload the files of a snapshot.

    `linked` files are copied within the bucket from the snapshot `earlier`. The list of files comes last: a snapshot
    without it is incomplete.
    """
    names = sorted(path.relative_to(written).as_posix() for path in written.rglob("*") if path.is_file())

    def send_one(name: str) -> None:
        if name in linked and earlier is not None and earlier != final:
            object_store.copy_object(f"{earlier.path}/{name}", f"{final.path}/{name}")
        elif name not in linked:
            object_store.upload_object(f"{final.path}/{name}", written / name)

    with ThreadPoolExecutor(object_store.MAX_CONCURRENT_REQUESTS) as threads:
        list(threads.map(send_one, (name for name in names if name != FILE_LIST_NAME)))
    send_one(FILE_LIST_NAME)
