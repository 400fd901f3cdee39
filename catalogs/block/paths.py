"""Paths that a block file names, resolved and checked."""

from __future__ import annotations

import difflib
import os
import re
import stat
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import cast

from catalogs.block.declared_keys import PathKind, declared_keys, stated_value
from catalogs.block.keys import BlockFileSettings
from catalogs.reader_errors import short_message
from catalogs.readers.formats import BUILDING_READERS, CENTRELINE_READERS
from catalogs.readers.pictures.picture_kinds import is_system_file
from catalogs.readers.referenced_files import find_in_other_form
from facade_core.core.errors import InputError
from facade_core.core.regular_files import read_regular

# Reference to an environment variable.
_VARIABLE = re.compile(r"\$\{(\w+)\}")
# Characters of a variable's value: shorter ones occur in any path.
_MIN_HIDDEN_LENGTH = 4
_RASTER_SUFFIXES = (".tif", ".tiff", ".asc", ".img", ".jp2", ".hgt", ".png", ".jpg", ".vrt")
_MAX_LISTED = 4  # files that a message names
_MAX_COMPARED = 1000  # names of a folder that are looked through
# Similarity of names, of at most 1, from which one is suggested for the other.
_MIN_SIMILARITY = 0.6


def path_keys() -> dict[str, PathKind]:
    """Return the dotted keys of a block file that hold paths, and what each names."""
    return {name: one.key.path for name, one in declared_keys(BlockFileSettings).items() if one.key.path is not None}


def resolve_paths(keys: BlockFileSettings, block: Path) -> dict[str, tuple[Path, ...]]:
    """Return dotted key -> existing paths, relative to the block file.

    `${NAME}` in a path is replaced with the environment variable.

    Raises
    ------
    ValueError : "key: problem; remedy" for the first path that cannot be used.
    """
    found = {}
    for key, kind in path_keys().items():
        stated = stated_value(keys, key)
        if stated is not None:
            texts = [stated] if isinstance(stated, str) else cast(list[str], stated)
            found[key] = tuple(resolve_path(key, text, block, kind) for text in texts)
    return found


def hide_variable_values(message: str, file: Path) -> str:
    """Return a message with the environment variables that a file names in place of their values.

    Values may be secret, and the user knows the path as it is written.
    """
    try:
        names = set(_VARIABLE.findall(read_regular(file).decode(errors="replace")))
    except (OSError, InputError):
        return message
    for name in names:
        value = os.environ.get(name, "")
        if not value:  # which would stand for the working directory
            continue
        for shown in (os.path.abspath(os.path.expanduser(value)), os.path.realpath(value), value):
            if len(shown) >= _MIN_HIDDEN_LENGTH:
                message = message.replace(shown, f"${{{name}}}")
    return message


def resolve_path(key: str, text: str, file: Path, kind: PathKind, *, file_kind: str = "block file") -> Path:
    """Return the existing path that a key names, relative to its file.

    `~` and `${NAME}` are expanded.

    Parameters
    ----------
    key : dotted key, for messages.
    text : path as written.
    file : file that names it.
    kind : what the key names; a regular file where no folder.
    file_kind : name of the kind of `file` in messages.

    Raises
    ------
    ValueError
        "key: problem; remedy" where the path cannot be used.
    """
    path = file.parent / _expand_user(key, _expand_variables(key, text))
    slashed = file.parent / _expand_user(key, _expand_variables(key, text.replace("\\", "/")))
    found = (find_in_other_form(one, fold_case=False) for one in (path, slashed))
    path = next((one for one in found if one is not None), path)
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        remedy = _missing_path_remedy(key, path, text, file.parent) or f"paths are relative to the {file_kind}"
        raise ValueError(f"{key}: {shorten_path(path)} does not exist; {remedy}") from None
    except OSError as error:  # name too long, cyclic links, no permission
        raise ValueError(
            f"{key}: {shorten_path(path)} cannot be opened ({error.strerror}); name another path"
        ) from error
    except ValueError as error:  # a name that the file system cannot hold
        raise ValueError(f"{key}: {ascii(text)[:60]} is no path ({short_message(error)}); name another one") from error
    if kind.is_file and not stat.S_ISREG(mode):
        what = (
            f"is a folder; {folder_remedy(key, path, kind)}"
            if stat.S_ISDIR(mode)
            else "is no file but a device; name a file"
        )
        raise ValueError(f"{key}: {path} {what}")
    return path


def _missing_path_remedy(key: str, path: Path, text: str, base: Path) -> str | None:
    """Return what to write in place of a path that leads nowhere; None where nothing tells."""
    if layer := re.search(r"\|layername=([^|]+)", text):
        return f"write path: {text[: layer.start()]}, layer: {layer[1]}"
    if re.match(r"[A-Za-z][\w+.-]+://|/vsi", text):
        return "download or unpack it, and name the file"
    if re.match(r"[A-Za-z]:[\\/]", text):
        return "it is a path of Windows; name the file by its path here"
    if geodatabase := next((one for one in path.parents if one.suffix.lower() == ".gdb" and one.is_dir()), None):
        return _geodatabase_remedy(geodatabase)
    if "*" in path.name or "?" in path.name:
        folder = Path(text.replace("\\", "/")).parent
        matching = [str(folder / one.name) for one in sorted(islice(path.parent.glob(path.name), _MAX_COMPARED))]
        return list_remedy(key, matching if _takes_list(key) else [text]) if matching else "no file has such a name"
    if other := find_in_other_form(path, fold_case=True):
        return f"did you mean {os.path.relpath(other, base)}?"
    if close := suggest_similar_file_name(path):
        return f"did you mean {close}?"
    variable = _VARIABLE.search(text)
    return f"check the environment variable {variable[1]}" if variable else None


def folder_remedy(key: str, folder: Path, kind: PathKind) -> str:
    """Return what to name in place of a folder, by the files in it."""
    try:
        inside = sorted(path.name for path in islice(folder.iterdir(), _MAX_COMPARED) if path.is_file())
    except OSError:
        return "name a file in it"
    if folder.suffix.lower() == ".gdb" or any(name.endswith(".gdbtable") for name in inside):
        return _geodatabase_remedy(folder)
    if any(name.endswith(".adf") for name in inside):
        return f"it is an Esri grid: convert it with gdal_translate {folder.name} OUT.tif"
    suffixes = _RASTER_SUFFIXES if kind is PathKind.RASTER else tuple({**BUILDING_READERS, **CENTRELINE_READERS})
    named = [name for name in inside if not is_system_file(name) and name.lower().endswith(suffixes)]
    if kind is PathKind.RASTER and len(named) > 1:
        return list_remedy(key, [f"{folder.name}/*{Path(named[0]).suffix}"])
    if _takes_list(key) and len(named) > 1:
        return f"name a file in it, or {list_remedy(key, [f'{folder.name}/{name}' for name in named])}"
    return f"name a file in it, such as {folder.name}/{named[0]}" if named else "name a file in it"


def _geodatabase_remedy(folder: Path) -> str:
    return f"it is a file geodatabase: convert it with ogr2ogr OUT.gpkg {folder.name}"


def list_remedy(key: str, paths: Sequence[str]) -> str:
    """Return how to name a list of files, or how to make one of them where a key takes one file."""
    if _takes_list(key):
        return f"write path: [{', '.join(paths[:_MAX_LISTED])}{', ...' if len(paths) > _MAX_LISTED else ''}]"
    names = " ".join(paths[:_MAX_LISTED]) + (" ..." if len(paths) > _MAX_LISTED else "")
    suffixes = {Path(path).suffix.lower() for path in paths}
    if not suffixes.isdisjoint(_RASTER_SUFFIXES):
        return f"make one of them with gdalwarp {names} joined.tif (or gdalbuildvrt joined.vrt {names}), and name it"
    if suffixes == {".pbf"}:
        return f"make one of them with osmium merge {names} -o joined.osm.pbf, and name it"
    return f"make one of them with ogrmerge.py -single -o joined.gpkg {names}, and name it"


def _takes_list(key: str) -> bool:
    declared = declared_keys(BlockFileSettings).get(key)
    return declared is not None and "list of" in declared.value_type


def shorten_path(path: Path, limit: int = 240) -> str:
    """Return the end of a path that is too long for a message."""
    text = str(path)
    return text if len(text) <= limit else f"...{text[-limit:]}"


def suggest_similar_file_name(path: Path) -> str | None:
    """Return the most similar name in the folder of a missing file; compares _MAX_COMPARED files at most."""
    try:
        near = [found.name for found in islice(path.parent.iterdir(), _MAX_COMPARED)]
    except OSError:
        return None

    def similarity(name: str) -> float:
        stem = name.removesuffix(path.suffix)  # a common ending alone makes no name similar
        return difflib.SequenceMatcher(None, stem, path.name if stem == name else path.stem).ratio()

    closest = max(sorted(near), key=similarity, default=None)
    return closest if closest and similarity(closest) >= _MIN_SIMILARITY else None


def _expand_user(key: str, text: str) -> Path:
    try:
        return Path(text).expanduser()
    except RuntimeError:
        user = text.partition("/")[0]
        raise ValueError(
            f"{key}: {text[:60]}: there is no user {user}; name the folder, or write ./ before it"
        ) from None


def _expand_variables(key: str, text: str) -> str:
    def expand(match: re.Match[str]) -> str:
        found = os.environ.get(match[1])
        if not found:
            raise ValueError(
                f"{key}: the environment variable {match[1]} is not set; set it to the folder that is meant"
            )
        return str(_expand_user(key, found).absolute())

    return _VARIABLE.sub(expand, text)
