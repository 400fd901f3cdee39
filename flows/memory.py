"""What a process lets go of goes back to the system."""

from __future__ import annotations

import ctypes
from contextlib import suppress

# Of malloc.h: from which size on memory is mapped by itself, and so goes back as soon as it is free.
_MMAP_THRESHOLD = -3
_LARGE_BYTES = 1 << 20


def release_large_allocations() -> None:
    """Have what is larger than a megabyte go back to the system when it is freed, in this process from here on.

    By itself glibc raises that size with whatever is freed, up to 32 MB, and keeps in its heaps what is smaller: one that reads
    tile after tile ends with a multiple of what it held at any time.
    """
    with suppress(OSError, AttributeError):  # another C library
        ctypes.CDLL(None).mallopt(_MMAP_THRESHOLD, _LARGE_BYTES)
