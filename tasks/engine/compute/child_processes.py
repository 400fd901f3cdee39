"""Processes that do not outlive the one that started them."""

from __future__ import annotations

import ctypes
import signal

# Loaded before a process is forked, of which only one thread goes on.
_LIBC = ctypes.CDLL(None)
_PARENT_DEATH_SIGNAL = 1


def end_with_parent() -> None:
    """As `preexec_fn` of a process: it is ended in order when the thread that starts it ends, however that comes about."""
    _LIBC.prctl(_PARENT_DEATH_SIGNAL, signal.SIGTERM)
