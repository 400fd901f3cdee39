"""One run at a time in an output folder."""

from __future__ import annotations

import errno
import fcntl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from facade_core.errors import InputError, MachineError

# Folders that this process holds: the command line locks before it starts a server, and the flow locks for itself.
_held: set[Path] = set()


@contextmanager
def locked(out: Path) -> Iterator[None]:
    """Make the folder `out` and hold it; the lock goes with the process, however it ends. It may be nested.

    Raises InputError when the folder cannot be written, or another run is at work in it.
    """
    out = out.resolve()
    if out in _held:
        yield
        return
    try:
        out.mkdir(parents=True, exist_ok=True)
        handle = (out / ".lock").open("w")
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise MachineError(
                f"{out}: {error.strerror}; free some space, or name another folder with --out"
            ) from error
        raise InputError(f"{out}: cannot be written ({error.strerror}); name another folder with --out") from error
    with handle:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise InputError(
                f"{out}: another run is at work in it; wait for it, or name another folder with --out"
            ) from error
        _held.add(out)
        try:
            yield
        finally:
            _held.discard(out)


def is_held(out: Path) -> bool:
    """Whether a run, of this process or another, is at work in the folder `out`."""
    try:
        with (out / ".lock").open() as handle:
            fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except BlockingIOError:
        return True
    return False
