"""Who reads a published snapshot holds its folder; who removes one asks first."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from catalogs.published.runs import Folder
from catalogs.published.s3 import S3Folder


@contextmanager
def being_read(folder: Folder) -> Iterator[None]:
    """Keep a published snapshot's folder from being pruned, until the process ends, however it does; any number may."""
    if isinstance(folder, S3Folder):
        yield
        return
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:  # whoever reads will say what is missing
        yield
        return
    with suppress(OSError):  # it is being removed, or the file system knows no locks
        fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    try:
        yield
    finally:
        os.close(handle)


@contextmanager
def alone(folder: Folder) -> Iterator[bool]:
    """Whether nobody holds a folder, and nobody can as long as the block lasts."""
    handle = os.open(str(folder), os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
        else:
            yield True
    finally:
        os.close(handle)
