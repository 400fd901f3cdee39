"""Pictures of a folder, matched to the entries of a file by the ends of their paths."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import takewhile
from pathlib import Path
from typing import TypeVar

from catalogs.printable_text import normal_form
from catalogs.reader_errors import to_single_line
from catalogs.readers.pictures.picture_kinds import is_picture_name

T = TypeVar("T")
Entry = TypeVar("Entry")


def select_entries(
    entries: Mapping[str, Entry | str], file: str, folder: Path, paths: Sequence[Path]
) -> dict[Path, Entry | str]:
    """Return the entry of each picture that has one, or why it is not known which.

    The entry has most folders and names at the end in common with the picture, in any letter case, with or without the
    suffix; a picture has an entry, and an entry a picture.

    Parameters
    ----------
    entries : entries, or why one cannot be used, by the path of a picture on any machine.
    file : name of the file of the entries, for messages.
    folder : folder of the pictures.
    paths : pictures in it or below.
    """
    by_stem: dict[str, list[str]] = {}
    for name in entries:
        by_stem.setdefault(_path_parts(name)[-1], []).append(name)
    names = {path: by_stem.get(_path_parts(str(path))[-1], []) for path in paths}
    owners: dict[str, list[Path]] = {}
    for path, found in names.items():
        for name in found:
            owners.setdefault(name, []).append(path)
    closest = {name: _most_alike(owners[name], partial(_likeness, folder, name=name)) for name in owners}
    selected: dict[Path, Entry | str] = {}
    for path, found in names.items():
        own = [name for name in _most_alike(found, partial(_likeness, folder, path)) if path in closest[name]]
        twin = next((other for name in own for other in closest[name] if other != path), None)
        if len(own) > 1:
            both = " and ".join(to_single_line(name[:60]) for name in own[:2])
            selected[path] = f"{both} in {file} may both be it; name pictures and their folders as there"
        elif own and twin is not None and not isinstance(entries[own[0]], str):
            both = " and ".join(one.relative_to(folder).as_posix() for one in (path, twin))
            selected[path] = f"{both} may both be {own[0]} of {file}; name pictures and their folders as there"
        elif own:
            selected[path] = entries[own[0]]
    return selected


def find_unmatched_names(names: Iterable[str], paths: Sequence[Path]) -> list[str]:
    """Return the names of entries that no picture has."""
    stems = {_path_parts(str(path))[-1] for path in paths}
    return [to_single_line(name[:80]) for name in names if _path_parts(name)[-1] not in stems]


def find_names(written: str, names: Iterable[str]) -> list[str]:
    """Return the names that end as a path does."""
    parts = _path_parts(written)
    return [name for name in names if _path_parts(name)[-len(parts) :] == parts]


def picture_id(path: Path, folder: Path) -> str:
    """Return the id of a picture: its path in a folder without suffix, as left-0000."""
    return normal_form("-".join(path.relative_to(folder).with_suffix("").parts))


def _most_alike(candidates: Sequence[T], likeness: Callable[[T], tuple[int, bool, bool]]) -> list[T]:
    best = max(map(likeness, candidates), default=None)
    return [one for one in candidates if likeness(one) == best]


def _likeness(folder: Path, path: Path, name: str) -> tuple[int, bool, bool]:
    """Return how many folders and names at the end a picture and an entry share, and what else is equal."""
    pairs = zip(_path_parts(str(path))[::-1], _path_parts(name)[::-1], strict=False)
    shared = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))
    stated = normal_form(name).replace("\\", "/").removeprefix("./")
    inside = normal_form(path.relative_to(folder).as_posix())
    return shared, stated.rpartition("/")[2] == normal_form(path.name), stated == inside


def _path_parts(text: str) -> tuple[str, ...]:
    """Return folders and name of a path of any machine, the name without suffix of a picture."""
    *folders, name = normal_form(text.casefold()).replace("\\", "/").removeprefix("./").split("/")
    return (*folders, Path(name).stem if is_picture_name(name) else name)
