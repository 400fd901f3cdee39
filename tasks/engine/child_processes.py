"""Child processes that end with their parent."""

from __future__ import annotations

import ctypes
import signal

# Loaded before a process is forked, of which only one thread goes on.
_LIBC = ctypes.CDLL(None)
_PARENT_DEATH_SIGNAL = 1


def end_with_parent() -> None:
    """End this process when the thread that started it ends; a `preexec_fn`."""
    _LIBC.prctl(_PARENT_DEATH_SIGNAL, signal.SIGTERM)
