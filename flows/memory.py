"""Return freed memory of a process to the operating system."""

from __future__ import annotations

import ctypes
from contextlib import suppress

# From malloc.h: size from which malloc maps memory separately, so that free returns it at once.
_MMAP_THRESHOLD = -3
_LARGE_BYTES = 1 << 20


def set_malloc_mmap_threshold() -> None:
    """Make malloc return allocations over one megabyte to the system once freed.

    By default glibc raises this threshold up to 32 MB with each freed allocation and keeps smaller ones in its heaps. A
    process that reads tile after tile then ends with a multiple of its peak of live memory.
    """
    with suppress(OSError, AttributeError):  # another C library
        ctypes.CDLL(None).mallopt(_MMAP_THRESHOLD, _LARGE_BYTES)
