"""numba's `njit`, with a cache of what it compiled for this code and no other.

By itself numba tells by a kernel's own file whether what it keeps is of now, not by the files of the kernels that this one
calls: after a new version a caller would go on with what it was once compiled with. So what a module's kernels are compiled to
lies in a folder with the digest of that module and of all that it imports of the package, in its name, and those of other code
beside it go.
"""

from __future__ import annotations

import os
import re
import shutil
import sys
import threading
from collections.abc import Callable
from functools import cache
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numba

_CONFIG: Any = numba.config
PACKAGE = Path(__file__).resolve().parent.parent
_IMPORTS = re.compile(
    rf"\b(?:from\s+({PACKAGE.name}[\w.]*)\s+import\s+(\([^)]*\)|[^\n]*)|import\s+({PACKAGE.name}[\w.]*))"
)
_DECORATING = threading.Lock()


def njit(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """`numba.njit` with options, whose cache stands on all code that a kernel's module imports."""

    def compiled(function: Callable[..., Any]) -> Any:
        with _DECORATING:  # numba reads the folder now, once for each kernel
            if CACHE is not None:
                _CONFIG.CACHE_DIR = str(_folder_of(function.__module__))
            return numba.njit(**options)(function)

    return compiled


def code_digest(module: str) -> str:
    """The digest of a module of the package and of all that it imports of it, at any depth."""
    digest = blake2b(f"{sys.version} {numba.__version__}".encode(), digest_size=8)
    for path in sorted(_reached(_paths(module))):
        digest.update(str(path.relative_to(PACKAGE)).encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


def _reached(paths: tuple[Path, ...]) -> set[Path]:
    reached: set[Path] = set()
    waiting = list(paths)
    while waiting:
        path = waiting.pop()
        if path not in reached:
            reached.add(path)
            waiting += _imported(path)
    return reached


@cache
def _imported(path: Path) -> tuple[Path, ...]:
    """What a file imports of the package. Words of a docstring that read like an import do no harm: they only add a file."""
    found: list[Path] = []
    for module, names, alone in _IMPORTS.findall(path.read_text(encoding="utf-8")):
        found += _paths(module or alone)
        for name in re.findall(r"\w+", names):
            found += _paths(f"{module}.{name}")
    return tuple(found)


@cache
def _paths(module: str) -> tuple[Path, ...]:
    """The file of a module or package; none where the name is of neither."""
    base = PACKAGE.joinpath(*module.split(".")[1:])
    return tuple(path for path in (base.with_suffix(".py"), base / "__init__.py") if path.is_file())


@cache
def _folder_of(module: str) -> Path:
    """Where what a module's kernels are compiled to is kept; folders of what that module was before go."""
    assert CACHE is not None
    folder = CACHE / module / code_digest(module)
    if not folder.is_dir():
        for before in folder.parent.glob("*"):
            shutil.rmtree(before, ignore_errors=True)
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def first_writable(folders: tuple[Path, ...]) -> Path | None:
    """The first of some folders that is there, or can be made, and can be written; None where none can."""
    for folder in folders:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    return None


def _places() -> tuple[Path, ...]:
    """Where the cache may be: where NUMBA_CACHE_DIR says, beside the code, or in the user's own cache. Several installations
    may share the first and the last, so these have a folder for each."""
    place = blake2b(str(PACKAGE).encode(), digest_size=8).hexdigest()
    if _CONFIG.CACHE_DIR:
        return (Path(_CONFIG.CACHE_DIR) / place,)
    return PACKAGE / "__pycache__" / "kernels", Path.home() / ".cache" / "streetloom" / place


CACHE = first_writable(_places())
