"""Files that a model names: its pictures, materials and buffers. They lie in the model's own folder or below it."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from urllib.parse import unquote

OUTSIDE_FOLDER_REASON = "pictures outside the folder of their model: not read; copy them beside it"


def find_referenced_file(model: Path, *names: str, folder: Path | None = None) -> Path | None:
    """The file that a model names, by the first of `names`, relative to `folder` or to the model's own, that leads to one.

    None where none does, or where it lies outside the model's folder, links followed: a model that somebody sent could show any
    picture of this machine.
    """
    return next((file for file in _existing_files(model, names, folder) if _is_below(file, model)), None)


def is_outside_folder(model: Path, *names: str, folder: Path | None = None) -> bool:
    """Whether one of the names leads to a file outside the model's folder."""
    return any(not _is_below(file, model) for file in _existing_files(model, names, folder))


def filename_variants(uri: str) -> tuple[str, ...]:
    """What a file may be called that a URI names: as it stands, unquoted, with the slashes of this system."""
    return tuple(dict.fromkeys(name.replace("\\", "/") for name in (uri, unquote(uri))))


def _existing_files(model: Path, names: Sequence[str], folder: Path | None) -> Iterator[Path]:
    files = ((folder or model.parent) / name for name in names if name)
    return (file for file in files if os.path.isfile(file))


def _is_below(file: Path, model: Path) -> bool:
    return file.resolve().is_relative_to(model.parent.resolve())
