"""Exclusive lock of an output folder, on this machine or in a bucket."""

from __future__ import annotations

import errno
import fcntl
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from catalogs.published.folders import Folder, local_run_folder
from catalogs.published.s3 import S3Path
from facade_core.atlas.store import check_before_commits
from facade_core.core.errors import InputError, MachineError
from flows.lease import FolderLease, hold_lease, lease_holder

# Locked folders of this process, with the lease of those in buckets. The command line locks before it starts a server, and
# the flow locks again.
_held_folders: dict[Folder, FolderLease | None] = {}


@contextmanager
def lock_folder(out: Folder) -> Iterator[None]:
    """Create and lock the folder `out` until the block ends; reentrant.

    The operating system releases the lock when the process ends. A folder in a bucket is locked by a lease, which expires
    some time after the process has ended, or at once where the next run is on the same machine. Commits into the store
    check the lease.

    Raises
    ------
    InputError
        The folder cannot be written, or another run holds it.
    MachineError
        The disk is full.
    """
    out = out.resolve()
    if out in _held_folders:
        yield
        return
    with ExitStack() as holds:
        local = local_run_folder(out)
        lease, token = None, holds.enter_context(_lock_local_folder(local, out))
        if isinstance(out, S3Path):
            lease = holds.enter_context(hold_lease(out, token))
            holds.enter_context(check_before_commits(out / "store", lease.require_valid))
        _held_folders[out] = lease
        try:
            yield
        finally:
            del _held_folders[out]


def require_lock(out: Folder) -> None:
    """Raise MachineError where the lease of a locked folder in a bucket may have expired."""
    if (lease := _held_folders[out.resolve()]) is not None:
        lease.require_valid()


@contextmanager
def _lock_local_folder(folder: Path, out: Folder) -> Iterator[int]:
    """Lock a folder of this machine for a run in `out`; yields the descriptor of the lock file."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder / ".lock", os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        name = "another folder with --out" if folder == out else "a folder that can be with XDG_CACHE_HOME"
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise MachineError(f"{folder}: {error.strerror}; free some space, or name {name}") from error
        raise InputError(f"{folder}: cannot be written ({error.strerror}); name {name}") from error
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise InputError(
                f"{out}: another run is at work in it; wait for it, or name another folder with --out"
            ) from error
        yield handle
    finally:
        os.close(handle)


def is_locked(out: Folder) -> bool:
    """Return True if a run of this or another process holds the folder `out`."""
    if isinstance(out, S3Path):
        return lease_holder(out) is not None
    try:
        with (out / ".lock").open() as handle:
            fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except BlockingIOError:
        return True
    return False
