"""A snapshot that was written on this machine, sent into the bucket that it is published in."""

from __future__ import annotations

from collections.abc import Collection
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from catalogs.published import object_store
from catalogs.published.file_list import FILES
from catalogs.published.s3 import S3Folder


def send(written: Path, final: S3Folder, earlier: S3Folder | None, linked: Collection[str]) -> None:
    """Send the files below a folder; those that are `linked` are copied within the bucket, from the snapshot `earlier`.

    The list of files comes last: a snapshot without it was not sent whole.
    """
    names = sorted(path.relative_to(written).as_posix() for path in written.rglob("*") if path.is_file())

    def send_one(name: str) -> None:
        if name in linked and earlier is not None and earlier != final:
            object_store.copy(f"{earlier.path}/{name}", f"{final.path}/{name}")
        elif name not in linked:
            object_store.put(f"{final.path}/{name}", written / name)

    with ThreadPoolExecutor(object_store.AT_ONCE) as threads:
        list(threads.map(send_one, (name for name in names if name != FILES)))
    send_one(FILES)
