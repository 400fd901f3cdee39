"""numba's `njit`, with a cache of what it compiled for this code and no other.

By itself numba tells by a kernel's own file whether what it keeps is of now, not by the files of the kernels that this one
calls: after a new version a caller would go on with what it was once compiled with. So the cache's folder has the digest of all
code in its name, and those of other code beside it go.
"""

from __future__ import annotations

import os
import shutil
import sys
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numba
from numba import njit

__all__ = ["CACHE", "njit"]

_CONFIG: Any = numba.config
PACKAGE = Path(__file__).resolve().parent


def folder_for(package: Path, parents: tuple[Path, ...]) -> Path | None:
    """The cache's folder for the code of a package, in the first of some folders that can be written; None where none can."""
    digest = blake2b(f"{sys.version} {numba.__version__}".encode(), digest_size=8)
    for path in sorted(package.rglob("*.py")):
        digest.update(str(path.relative_to(package)).encode() + b"\0" + path.read_bytes() + b"\0")
    for parent in parents:
        folder = parent / f"kernels-{digest.hexdigest()}"
        try:
            if not folder.is_dir():
                folder.mkdir(parents=True, exist_ok=True)
                for other in set(parent.glob("kernels-*")) - {folder}:
                    shutil.rmtree(other, ignore_errors=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    return None


def _parents() -> tuple[Path, ...]:
    """Where the cache may be: where NUMBA_CACHE_DIR says, beside the code, or in the user's own cache. Several installations
    may share the first and the last, so these have a folder for each."""
    place = blake2b(str(PACKAGE).encode(), digest_size=8).hexdigest()
    if _CONFIG.CACHE_DIR:
        return (Path(_CONFIG.CACHE_DIR) / place,)
    return PACKAGE / "__pycache__", Path.home() / ".cache" / "streetloom" / place


CACHE = folder_for(PACKAGE, _parents())
if CACHE is not None:
    _CONFIG.CACHE_DIR = str(CACHE)
