"""Check of a folder before its first run or city."""

from __future__ import annotations

from pathlib import Path

from catalogs.published.folders import Folder
from facade_core.core.errors import InputError

# What a run, a city or the demo writes first.
_OWN_NAMES = {".lock", "input", "store", "source", "logs", "prefect", "city.json"}
MAX_NAMED_FILES = 3


def check_output_folder(out: Folder) -> None:
    """Raise InputError where a first run would write beside files that no run wrote."""
    if not isinstance(out, Path) or not out.is_dir():
        return
    found = sorted(entry.name for entry in out.iterdir())
    if found and not _OWN_NAMES.intersection(found):
        named = ", ".join(found[:MAX_NAMED_FILES]) + (", ..." if len(found) > MAX_NAMED_FILES else "")
        raise InputError(f"{out}: holds other files ({named}); name a new or empty folder with --out")
