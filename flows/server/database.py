"""Cache of the empty database of the Prefect server, whose creation dominates the server's start."""

from __future__ import annotations

import os
import shutil
import sqlite3
from contextlib import closing, suppress
from importlib.metadata import version
from pathlib import Path

from facade_core.core.cache_folders import user_cache_folder
from facade_core.core.errors import InputError

DATABASE_NAME = "prefect.db"


def restore_database(home: Path) -> bool:
    """Copy the cached database into `home` unless it has one; return whether `home` has one now. Damaged ones count as none."""
    database = home / DATABASE_NAME
    if database.is_file():
        if _is_whole(database):
            return True
        for suffix in ("", "-wal", "-shm"):
            Path(f"{database}{suffix}").unlink(missing_ok=True)
    temporary = database.with_suffix(".tmp")
    try:
        shutil.copyfile(_cached_database(), temporary)
        if not _is_whole(temporary):
            temporary.unlink()
            return False
        temporary.replace(database)
    except (OSError, InputError):  # no readable cache: the server creates its own
        return False
    return True


def _is_whole(database: Path) -> bool:
    try:
        with closing(sqlite3.connect(database)) as file:
            return bool(file.execute("PRAGMA quick_check").fetchone() == ("ok",))
    except sqlite3.Error:
        return False


def cache_database(home: Path) -> None:
    """Cache the database that a server has just created in `home`."""
    database = home / DATABASE_NAME
    if not database.is_file():  # the user's settings use another path
        return
    try:
        kept = _cached_database()
    except InputError:  # no folder can be written
        return
    temporary = kept.with_suffix(f".{os.getpid()}.tmp")
    try:
        kept.parent.mkdir(parents=True, exist_ok=True)
        with closing(sqlite3.connect(database)) as source, closing(sqlite3.connect(temporary)) as target:
            source.backup(target)
        temporary.replace(kept)
    except (OSError, sqlite3.Error):  # only costs the next run a slower start
        with suppress(OSError):
            temporary.unlink()


def _cached_database() -> Path:
    """Return the cache path for this version of Prefect, in the user's cache folder."""
    return user_cache_folder() / "streetloom" / f"prefect-{version('prefect')}.db"
