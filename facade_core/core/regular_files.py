"""Opening of regular files only: a FIFO blocks for ever, and a device may never end."""

from __future__ import annotations

import os
import stat
from functools import cache
from io import BufferedReader
from pathlib import Path

from facade_core.core.errors import InputError

# Texts of a user that are read at once: corrections, annotations, indexes, tables.
MAX_TEXT_BYTES = 64 * 2**20
# Files of models that are read at once.
MAX_MODEL_BYTES = 2**30
_MEGABYTE = 10**6


def open_regular(path: Path, max_bytes: int | None = None) -> BufferedReader:
    """Open a regular file for reading, without waiting.

    Errors of the system, such as a missing file, pass unchanged.

    Parameters
    ----------
    path : file.
    max_bytes : largest accepted size; None: any.

    Raises
    ------
    InputError
        Where the path is no regular file, or a larger one.
    """
    require_regular(path)  # opening a device may have effects
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        state = os.fstat(handle)  # another file may have taken the name
        _require_regular_state(path, state)
        if max_bytes is not None and state.st_size > max_bytes:
            size = f"{max_bytes / _MEGABYTE:.0f} MB" if max_bytes >= _MEGABYTE else f"{max_bytes} bytes"
            raise InputError(f"{path} has more than {size}; give the file that is meant, or a part of it")
        return os.fdopen(handle, "rb")
    except BaseException:
        os.close(handle)
        raise


def read_regular(path: Path, max_bytes: int = MAX_TEXT_BYTES) -> bytes:
    """Read a regular file; see `open_regular`.

    Raises
    ------
    InputError
        Where the path is no regular file, or holds more than `max_bytes`.
    """
    with open_regular(path, max_bytes) as file:
        size = os.fstat(file.fileno()).st_size
        content = file.read(size + 1)  # a read takes memory for as much as it asks for
        if len(content) > size:  # it grew
            content += file.read(max_bytes + 1 - len(content))
    if len(content) > max_bytes:
        raise InputError(f"{path} has more than {max_bytes} bytes; give the file that is meant, or a part of it")
    return content


def require_regular(path: Path) -> None:
    """Raise InputError where a path exists and is no regular file; errors of the system pass unchanged."""
    _require_regular_state(path, path.stat())


def _require_regular_state(path: Path, state: os.stat_result) -> None:
    if not stat.S_ISREG(state.st_mode) or state.st_dev in _system_devices():
        kind = "a folder" if stat.S_ISDIR(state.st_mode) else "a pipe, a socket, a device or a file of the system"
        raise InputError(f"{path} cannot be opened: it is {kind}; name a file")


@cache
def _system_devices() -> frozenset[int]:
    """Return the devices of file systems whose files look regular, and may have no end or block."""
    return frozenset(os.stat(folder).st_dev for folder in ("/proc", "/sys") if os.path.ismount(folder))
