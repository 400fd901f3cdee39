"""Lock of a run in a bucket: an object with its holder and expiry time, renewed while the run is in progress.

A process cannot hold an object as it holds a file, so the lock is a lease. Every write of the object has the condition
that it did not change meanwhile.
"""

from __future__ import annotations

import json
import logging
import os
import socket
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from threading import Event, Thread

from catalogs.published import object_store
from catalogs.published.s3 import S3Path
from facade_core.core.errors import FacadeError, InputError, MachineError

log = logging.getLogger(__name__)

LOCK_NAME = ".lock"
LEASE_S = 120.0  # lifetime of a lease
RENEWAL_S = 30.0  # interval between renewals
# The holder stops commits this long before the lease expires: clocks of machines may differ.
CLOCK_MARGIN_S = 30.0


@dataclass
class FolderLease:
    """Lease of a run on its folder in a bucket.

    Attributes
    ----------
    out : the folder.
    token : unique to this lease.
    tag : version of the object that this run wrote.
    renewed : `time.monotonic()` of the last renewal.
    new_holder : description of the run that took the lease over; None while this run holds it.
    released : set when the run ends.
    """

    out: S3Path
    token: str
    tag: str
    renewed: float
    new_holder: str | None = None
    released: Event = field(default_factory=Event)

    def require_valid(self) -> None:
        """Raise MachineError where another run may have taken the folder over."""
        if self.new_holder is not None:
            raise MachineError(f"{self.out}: {self.new_holder} took its lock over; let that run end, and run again")
        if time.monotonic() > self.renewed + LEASE_S - CLOCK_MARGIN_S:
            raise MachineError(
                f"{self.out}: its lock could not be renewed in time; see to the network, and run again: finished work is kept"
            )

    def renew(self) -> None:
        """Extend the lease from now on."""
        began = time.monotonic()
        tag = object_store.upload_if_unchanged(_lock_path(self.out), _encode_lease(self.token), self.tag)
        if tag is None:
            found = lease_holder(self.out)
            self.new_holder = found[0] if found else "another run"
        else:
            self.tag, self.renewed = tag, began


@contextmanager
def hold_lease(out: S3Path, handle: int) -> Iterator[FolderLease]:
    """Hold a lease on a folder in a bucket until the block ends.

    Parameters
    ----------
    out : the folder.
    handle : descriptor of the file by which this process locks the folder's local side. It stores the token: the lease of
        an ended process of this machine is taken over at once, any other lease after it expires.

    Raises
    ------
    InputError
        Another run holds the folder; the message names it and the expiry time.
    """
    token = uuid.uuid4().hex
    kept = os.pread(handle, 64, 0).decode(errors="replace")
    tag = _acquire_lease(out, token, kept)
    _require_conditions(out)
    os.ftruncate(handle, 0)
    os.pwrite(handle, token.encode(), 0)
    lease = FolderLease(out, token, tag, time.monotonic())
    thread = Thread(target=_renew_until_released, args=(lease,), name="lease", daemon=True)
    thread.start()
    try:
        yield lease
    finally:
        lease.released.set()
        thread.join()
        if lease.new_holder is None:
            try:  # a remaining lease expires soon
                object_store.delete_objects([_lock_path(out)])
            except (FacadeError, OSError) as error:
                log.warning("%s: its lock stays until it is over (%s)", out, error)


def lease_holder(out: S3Path) -> tuple[str, datetime] | None:
    """Return the holder of a folder in a bucket and the expiry time; None where the folder is free."""
    found = object_store.download_object(_lock_path(out))
    held = _decode_lease(found[0]) if found else None
    return None if held is None or held[1] <= datetime.now(UTC) else held[:2]


def _acquire_lease(out: S3Path, token: str, previous_token: str) -> str:
    """Write the lease and return the tag of the object."""
    for _ in range(3):
        found = object_store.download_object(_lock_path(out))
        held = _decode_lease(found[0]) if found else None
        if held is not None and held[1] > datetime.now(UTC) and held[2] != previous_token:
            owner, until, _ = held
            raise InputError(
                f"{out}: another run is at work in it: {owner}, whose lock lasts until {until:%H:%M:%S} UTC unless renewed; "
                "wait for it, or name another folder with --out"
            )
        if (
            tag := object_store.upload_if_unchanged(_lock_path(out), _encode_lease(token), found[1] if found else None)
        ) is not None:
            if held is not None and held[2] != previous_token:
                log.warning("%s: took over the lock of %s, which was over at %s", out, held[0], held[1])
            return tag
    raise InputError(f"{out}: other runs begin in it at the same time; run again")


def _require_conditions(out: S3Path) -> None:
    """Raise InputError where a bucket ignores conditional writes: concurrent runs would lose commits."""
    for condition in (None, f'"{"0" * 32}"'):
        if object_store.upload_if_unchanged(_lock_path(out), b"{}", condition) is not None:
            object_store.delete_objects([_lock_path(out)])
            raise InputError(
                f"{out}: its bucket keeps no conditions on writing (If-Match, If-None-Match), by which runs keep apart; name "
                "one that does, or a folder, and copy it there with `streetloom catalog FOLDER --to s3://...`"
            )


def _renew_until_released(lease: FolderLease) -> None:
    while not lease.released.wait(RENEWAL_S) and lease.new_holder is None:
        try:
            lease.renew()
        except (
            FacadeError,
            OSError,
        ) as error:  # tried again; commits check the time of the last success
            log.warning("%s: its lock is not renewed (%s)", lease.out, error)


def _encode_lease(token: str) -> bytes:
    until = datetime.fromtimestamp(time.time() + LEASE_S, UTC)
    held = {"host": socket.gethostname(), "pid": os.getpid(), "run": token, "until": until.isoformat()}
    return json.dumps(held).encode()


def _decode_lease(data: bytes) -> tuple[str, datetime, str] | None:
    """Return owner, expiry time and token; None where the data is not a lease."""
    try:
        held = json.loads(data)
        owner = f"process {int(held['pid'])} on {str(held['host'])!r} (run {str(held['run'])[:8]})"
        return owner, datetime.fromisoformat(held["until"]), str(held["run"])
    except (ValueError, KeyError, TypeError):
        return None


def _lock_path(out: S3Path) -> str:
    return f"{out.path}/{LOCK_NAME}"
