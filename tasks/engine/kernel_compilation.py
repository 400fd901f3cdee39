"""Compilation of numba kernels, shared by the workers of a machine: one compiles each part, all read it from the cache."""

from __future__ import annotations

import fcntl
import gc
import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

log = logging.getLogger(__name__)

# Seconds that another process is waited for.
MAX_WAIT_S = 120.0
# New objects after which garbage is collected while kernels are compiled.
COMPILING_GC_OBJECTS = 100_000


def has_compiled_kernels() -> bool:
    """Report whether this machine has compiled all kernels of the present code; True where nothing can be kept."""
    from facade_core.core.numba_cache import CACHE_FOLDER

    return CACHE_FOLDER is None or _compiled_mark(CACHE_FOLDER).exists()


def _compiled_mark(folder: Path) -> Path:
    """Return the file that exists once all kernels of the present code are in a cache folder."""
    from facade_core.core.numba_cache import code_digest

    return folder / f"compiled-{code_digest('facade_core.kernel_warmup')}"


def compile_kernels_once() -> None:
    """Compile all kernels that units call into numba's cache; returns at once if that was done before.

    A part that another process compiles is waited for at the end, for a bounded time: a stopped process must not block others.
    """
    from facade_core.core.numba_cache import CACHE_FOLDER
    from facade_core.kernel_warmup import WARMUPS

    if CACHE_FOLDER is None:  # nothing can be shared
        return
    try:
        done = _compiled_mark(CACHE_FOLDER)
        if done.exists():
            return
        left = [part for part in WARMUPS if not _compile_part(CACHE_FOLDER / f"{part.__name__}.lock", part, wait=False)]
        if all([_compile_part(CACHE_FOLDER / f"{part.__name__}.lock", part, wait=True) for part in left]):
            for before in CACHE_FOLDER.glob("compiled-*"):
                before.unlink(missing_ok=True)
            done.touch()
    except Exception as error:  # units compile what they need, and say what is wrong
        log.debug("what is compiled cannot be shared in %s: %s", CACHE_FOLDER, error)


def _compile_part(lock: Path, part: Callable[[], None], *, wait: bool) -> bool:
    """Compile a part under its lock; False if another process holds the lock."""
    until = time.monotonic() + (MAX_WAIT_S if wait else 0.0)
    with lock.open("a") as handle:
        while True:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if time.monotonic() >= until:
                    return False
                time.sleep(0.2)
        with collect_garbage_rarely():
            part()
        return True


@contextmanager
def collect_garbage_rarely() -> Iterator[None]:
    """Collect garbage after COMPILING_GC_OBJECTS new objects, and only among new ones.

    The compiler makes millions of objects and keeps most of them, and Python's usual 700 make it visit them all again
    and again.
    """
    before = gc.get_threshold()
    gc.freeze()
    gc.set_threshold(COMPILING_GC_OBJECTS, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)
        gc.unfreeze()
