"""Files that a model references: pictures, materials and buffers in the folder of the model or below it."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from urllib.parse import unquote

NO_FILE_REASON = "pictures that are no files but folders, pipes or devices: not read; put the pictures in their place"
OUTSIDE_FOLDER_REASON = "pictures outside the folder of their model: not read; copy them beside it"


def find_referenced_file(model: Path, *names: str, folder: Path | None = None) -> Path | None:
    """Return the first existing file in the folder of the model, else None.

    Links are resolved: a received model could otherwise show any picture of this machine.

    Parameters
    ----------
    model : file of the model.
    names : names of the referenced file in order of preference.
    folder : base of relative names; None for the folder of the model.
    """
    return next((file for file in _existing_files(model, names, folder) if _is_below(file, model)), None)


def is_outside_folder(model: Path, *names: str, folder: Path | None = None) -> bool:
    """Return True where one of the names leads to a file outside the folder of the model.

    Parameters
    ----------
    model : file of the model.
    names : names of the referenced file.
    folder : base of relative names; None for the folder of the model.
    """
    return any(not _is_below(file, model) for file in _existing_files(model, names, folder))


def is_no_file(model: Path, *names: str, folder: Path | None = None) -> bool:
    """Return True where one of the names leads to a folder, a pipe or a device below the folder of the model."""
    files = [(folder or model.parent) / name for name in names if name]
    return any(os.path.exists(file) and not os.path.isfile(file) and _is_below(file, model) for file in files)


def filename_variants(uri: str) -> tuple[str, ...]:
    """Return the possible file names of a URI: as written and unquoted, with forward slashes."""
    return tuple(dict.fromkeys(name.replace("\\", "/") for name in (uri, unquote(uri))))


def _existing_files(model: Path, names: Sequence[str], folder: Path | None) -> Iterator[Path]:
    files = ((folder or model.parent) / name for name in names if name)
    return (found for file in files if (found := _find_in_any_case(file)) is not None)


def _find_in_any_case(file: Path) -> Path | None:
    """Return a file by its name, else by its name in other letter case, as some systems find it."""
    if os.path.isfile(file):
        return file
    try:
        names = _names_by_folded_name(str(file.parent), os.stat(file.parent).st_mtime_ns)
    except (OSError, ValueError):
        return None
    found = file.parent / names.get(file.name.casefold(), file.name)
    return found if os.path.isfile(found) else None


@lru_cache(maxsize=16)
def _names_by_folded_name(folder: str, modified_ns: int) -> dict[str, str]:
    """Return the names in a folder by their letters in one case; `modified_ns` renews the list after a change."""
    return {name.casefold(): name for name in sorted(os.listdir(folder), reverse=True)}


def _is_below(file: Path, model: Path) -> bool:
    return file.resolve().is_relative_to(model.parent.resolve())
