"""An empty database of the Prefect server, kept for the next run: to create one takes longer than all else at its start."""

from __future__ import annotations

import os
import shutil
import sqlite3
from contextlib import closing, suppress
from importlib.metadata import version
from pathlib import Path

DATABASE_NAME = "prefect.db"


def restore_database(home: Path) -> bool:
    """Put a copy of the kept database into `home` unless it has one; whether `home` has one now."""
    database = home / DATABASE_NAME
    if not database.is_file():
        temporary = database.with_suffix(".tmp")
        try:
            shutil.copyfile(_cached_database(), temporary)
            temporary.replace(database)
        except OSError:  # none is kept yet, or it cannot be read: the server creates its own
            return False
    return True


def cache_database(home: Path) -> None:
    """Keep the database that a server has just created in `home`."""
    database, kept = home / DATABASE_NAME, _cached_database()
    if not database.is_file():  # the user's settings put it elsewhere
        return
    temporary = kept.with_suffix(f".{os.getpid()}.tmp")
    try:
        kept.parent.mkdir(parents=True, exist_ok=True)
        with closing(sqlite3.connect(database)) as source, closing(sqlite3.connect(temporary)) as target:
            source.backup(target)
        temporary.replace(kept)
    except (OSError, sqlite3.Error):  # the next run takes longer to start, no more
        with suppress(OSError):
            temporary.unlink()


def _cached_database() -> Path:
    """Of this version of Prefect, in the user's cache folder."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return cache / "streetloom" / f"prefect-{version('prefect')}.db"
