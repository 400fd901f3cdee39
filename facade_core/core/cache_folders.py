"""Folders for caches of a user, also of one without a home that can be written, as in containers."""

from __future__ import annotations

import os
import stat
import tempfile
from contextlib import suppress
from pathlib import Path

from facade_core.core.errors import InputError


def user_cache_folder() -> Path:
    """Return $XDG_CACHE_HOME, else ~/.cache, else a private temporary folder; it may not exist yet.

    Raises
    ------
    InputError
        Where none of them can be written.
    """
    if stated := os.environ.get("XDG_CACHE_HOME"):
        return Path(stated)
    with suppress(RuntimeError):  # no home
        folder = Path.home() / ".cache"
        if _can_be_made(folder):
            return folder
    folder_of_user = private_temporary_folder("streetloom-cache")
    if folder_of_user is None:
        raise InputError("neither the home nor the temporary folder can be written; name a folder with XDG_CACHE_HOME")
    return folder_of_user


def private_temporary_folder(name: str) -> Path | None:
    """Return a folder of this user alone in the temporary folder; None where there is none.

    The user's processes share it. A folder that another user could have created is not used, because cached code is run.
    """
    try:
        folder = Path(tempfile.gettempdir()) / f"{name}-{os.getuid()}"
        folder.mkdir(mode=0o700, exist_ok=True)
        state = folder.lstat()
    except OSError:
        return None
    is_private = stat.S_ISDIR(state.st_mode) and state.st_uid == os.getuid() and not state.st_mode & 0o077
    return folder if is_private else None


def _can_be_made(folder: Path) -> bool:
    """Return True where a folder can be written, or created with its parents."""
    standing = next(parent for parent in (folder, *folder.parents) if parent.exists())
    return standing.is_dir() and os.access(standing, os.W_OK | os.X_OK)
