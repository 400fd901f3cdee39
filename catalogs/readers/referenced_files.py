"""Files that a model references: pictures, materials and buffers in the folder of the model or below it."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
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
    return (file for file in files if os.path.isfile(file))


def _is_below(file: Path, model: Path) -> bool:
    return file.resolve().is_relative_to(model.parent.resolve())
