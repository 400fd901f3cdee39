"""Files that a model references: pictures, materials and buffers in the folder of the model or below it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from urllib.parse import unquote

from catalogs.printable_text import normal_form

NO_FILE_REASON = "pictures that are no files but folders, pipes or devices: not read; put the pictures in their place"
OUTSIDE_FOLDER_REASON = "pictures outside the folder of their model: not read; copy them beside it"


def find_referenced_file(model: Path, *names: str, folder: Path | None = None) -> Path | None:
    """Return the first existing file in the folder of the model, else None.

    Links are resolved: a received model could otherwise show any picture of this machine.

    Parameters
    ----------
    model : file of the model.
    names : names or URIs of the referenced file in order of preference.
    folder : base of relative names; None for the folder of the model.
    """
    files = map(_find_file, _named_paths(model, names, folder))
    return next((file for file in files if file is not None and _is_below(file, model)), None)


def unread_file_reason(model: Path, *names: str, folder: Path | None = None) -> str | None:
    """Return why something that a model references is not read although it exists; None where nothing exists.

    Parameters
    ----------
    model : file of the model.
    names : names or URIs of the referenced file.
    folder : base of relative names; None for the folder of the model.
    """
    paths = _named_paths(model, names, folder)
    if any((file := _find_file(path)) is not None and not _is_below(file, model) for path in paths):
        return OUTSIDE_FOLDER_REASON
    is_other = any(os.path.exists(path) and not os.path.isfile(path) and _is_below(path, model) for path in paths)
    return NO_FILE_REASON if is_other else None


def _named_paths(model: Path, names: Sequence[str], folder: Path | None) -> list[Path]:
    """Return the possible paths of names, as written and unquoted, with forward slashes."""
    variants = dict.fromkeys(text.replace("\\", "/") for name in names if name for text in (name, unquote(name)))
    return [(folder or model.parent) / name for name in variants]


def _find_file(path: Path) -> Path | None:
    """Return a file by its name, else by its name in other letter case, as some systems find it."""
    found = find_in_other_form(path, fold_case=True)
    return found if found is not None and os.path.isfile(found) else None


def find_in_other_form(path: Path, *, fold_case: bool) -> Path | None:
    """Return an existing path by its name, else by names of the same normal form of Unicode; None without one.

    Parameters
    ----------
    path : path as written.
    fold_case : whether letter case may differ too.
    """
    if os.path.exists(path):
        return path
    found = Path(path.anchor)
    for part in path.parts[1 if path.anchor else 0 :]:
        named = found / part
        if not os.path.exists(named):
            try:
                names = _names_by_form(str(found), os.stat(found).st_mtime_ns, fold_case)
            except (OSError, ValueError):
                return None
            if (name := names.get(_comparable_name(part, fold_case))) is None:
                return None
            named = found / name
        found = named
    return found


@lru_cache(maxsize=16)
def _names_by_form(folder: str, modified_ns: int, fold_case: bool) -> dict[str, str]:
    """Return the names in a folder by the form in which they are compared; `modified_ns` renews the list after a change."""
    return {_comparable_name(name, fold_case): name for name in sorted(os.listdir(folder), reverse=True)}


def _comparable_name(name: str, fold_case: bool) -> str:
    return normal_form(name.casefold() if fold_case else name)


def _is_below(file: Path, model: Path) -> bool:
    return file.resolve().is_relative_to(model.parent.resolve())
