"""`njit` of numba with a compilation cache keyed by the code that a kernel depends on.

numba itself checks only a kernel's own file, not those of the kernels that it calls: after an update a caller would run
stale machine code. So each module caches in a folder named by the digest of itself and of its imports from the package.
Folders of older code are deleted.
"""

from __future__ import annotations

import os
import shutil
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from hashlib import blake2b
from pathlib import Path
from typing import Any, Literal, TypedDict, TypeVar, Unpack, cast

import numba

from facade_core.core.cache_folders import private_temporary_folder
from facade_core.core.code_modules import collect_modules

Kernel = TypeVar("Kernel", bound=Callable[..., object])
_CONFIG: Any = numba.config  # numba sets its attributes from the environment
PACKAGE_FOLDER = Path(__file__).resolve().parent.parent
_DECORATION_LOCK = threading.Lock()
# Name of this installation in shared folders.
_INSTALLATION = blake2b(str(PACKAGE_FOLDER).encode(), digest_size=8).hexdigest()


class KernelOptions(TypedDict, total=False):
    """Options of `numba.njit` that kernels of the package use."""

    cache: bool
    nogil: bool
    inline: Literal["never", "always"]
    forceinline: bool
    error_model: Literal["python", "numpy"]
    fastmath: bool | set[str]


def njit(**options: Unpack[KernelOptions]) -> Callable[[Kernel], Kernel]:
    """Return `numba.njit` with options, cached by all code that the kernel's module imports."""

    def decorate(function: Kernel) -> Kernel:
        with _DECORATION_LOCK:  # numba reads CACHE_DIR when it decorates a kernel
            if CACHE_FOLDER is not None:
                _CONFIG.CACHE_DIR = str(_cache_folder(function.__module__))
            else:  # numba refuses to cache where it finds no folder
                options["cache"] = False
            return cast(Kernel, numba.njit(**options)(function))

    return decorate


def code_digest(module: str) -> str:
    """Compute the digest of a module of the package and of its imports from it, at any depth."""
    digest = blake2b(f"{sys.version} {numba.__version__}".encode(), digest_size=8)
    for name, found in sorted(collect_modules([module], (), PACKAGE_FOLDER.parent, {PACKAGE_FOLDER.name}).items()):
        digest.update(f"{name} {found.digest}\n".encode())
    return digest.hexdigest()


@cache
def _cache_folder(module: str) -> Path:
    """Return a module's cache folder, and delete those of older code."""
    assert CACHE_FOLDER is not None
    folder = CACHE_FOLDER / module / code_digest(module)
    if not folder.is_dir():
        for before in folder.parent.glob("*"):
            shutil.rmtree(before, ignore_errors=True)
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def first_writable_folder(folders: tuple[Path, ...]) -> Path | None:
    """Return the first folder that exists or can be created, and is writable; None without one."""
    for folder in folders:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    return None


def _candidate_folders() -> tuple[Path, ...]:
    """Return possible cache folders: NUMBA_CACHE_DIR, or one in the package and one in the user's cache.

    Shared folders get a subfolder per installation.
    """
    if _CONFIG.CACHE_DIR:
        return (Path(_CONFIG.CACHE_DIR) / _INSTALLATION,)
    folders = [PACKAGE_FOLDER / "__pycache__" / "kernels"]
    with suppress(RuntimeError):  # a user without a home, as in containers
        folders.append(Path.home() / ".cache" / "streetloom" / _INSTALLATION)
    return tuple(folders)


def find_cache_folder() -> Path | None:
    """Return the folder of the compilation cache, at worst a temporary one; None without any."""
    if (found := first_writable_folder(_candidate_folders())) is not None:
        return found
    temporary = private_temporary_folder("streetloom-kernels")
    return None if temporary is None else first_writable_folder((temporary / _INSTALLATION,))


CACHE_FOLDER = find_cache_folder()
