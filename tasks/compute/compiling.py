"""What is compiled on first use is shared by the workers of a machine: each part is compiled by one, and read by all from
numba's cache."""

from __future__ import annotations

import fcntl
import logging
import sys
from collections.abc import Callable
from hashlib import blake2b
from pathlib import Path

import facade_core

log = logging.getLogger(__name__)


def compile_together() -> None:
    """Have everything in numba's cache that units call; at once where it was done before.

    A part that another process is at work on is left to it, and waited for at the end.
    """
    from facade_core.compiled import PARTS, cache_folder

    folder = cache_folder()
    if folder is None:  # nothing can be shared
        return
    try:
        done = folder / f"compiled-{_made_of()}"
        if done.exists():
            return
        left = [part for part in PARTS if not _compiled(folder / f"{part.__name__}.lock", part, wait=False)]
        for part in left:
            _compiled(folder / f"{part.__name__}.lock", part, wait=True)
        done.touch()
    except OSError as error:  # units compile what they need
        log.debug("what is compiled cannot be shared in %s: %s", folder, error)


def _compiled(lock: Path, part: Callable[[], None], *, wait: bool) -> bool:
    """Go through a part alone; False where another does."""
    with lock.open("a") as handle:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            return False
        part()
        return True


def _made_of() -> str:
    """What numba tells whether its cache is of now by: the modules as they lie on the disk, and versions."""
    import numba

    digest = blake2b(f"{sys.version} {numba.__version__}".encode(), digest_size=8)
    for path in sorted(Path(facade_core.__path__[0]).rglob("*.py")):
        about = path.stat()
        digest.update(f"{path.name} {about.st_size} {about.st_mtime_ns}\n".encode())
    return digest.hexdigest()
