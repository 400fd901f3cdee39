"""Published runs in a folder on this machine or in a bucket."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import compress
from operator import not_
from typing import Generic, cast

from catalogs.features import natural_sort_key
from catalogs.printable_text import format_command
from catalogs.published.folders import F, Folder, map_concurrently
from facade_core.core.errors import InputError

# File in a city's folder that lists its blocks, written at the start.
CITY_FILE_NAME = "city.json"
# Folder of the runs of its blocks, in the city's folder.
CITY_BLOCKS_FOLDER = "blocks"


@dataclass(frozen=True)
class PublishedRun(Generic[F]):
    """Folder and name of a run.

    Attributes
    ----------
    folder : folder of the run.
    name : relative to the folder of runs that was asked for, or the folder's own name.
    """

    folder: F
    name: str


def find_runs(folder: F) -> tuple[list[PublishedRun[F]], list[str]]:
    """Find the published runs: `folder` itself, or those at most two levels down.

    A run is recognised by its `current`, or by its store before it has published; its folder is not searched further.

    Returns
    -------
    Published runs, and a line about each run that has not published.

    Raises
    ------
    InputError : no run has published.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; {publish_hint(folder, 'makes it')}")
    if (folder / "current").is_file():
        return [PublishedRun(folder, folder.resolve().name)], []
    runs: list[PublishedRun[F]] = []
    left_out: list[str] = []
    waiting = [folder]
    while waiting:
        parent = waiting.pop()
        try:
            children = sorted(_subfolders(parent), key=str)
            for child, holds in zip(children, map_concurrently(_run_marker, children, folder), strict=True):
                name = str(child)[len(str(folder)) :].strip("/")
                if holds == "current":
                    runs.append(PublishedRun(child, name))
                elif holds == "store":
                    left_out.append(f"{name} is left out: nothing is published there yet")
                elif parent == folder:
                    waiting.append(child)
        except OSError as error:
            left_out.append(f"{parent} is left out: {error.strerror}")
    if not runs:
        raise InputError(f"{folder}: nothing is published there; {publish_hint(folder, 'finishes and publishes')}")
    runs.sort(key=lambda run: natural_sort_key(run.name))
    return runs, sorted(left_out, key=natural_sort_key)


def find_runs_with_store(folder: F) -> dict[str, F]:
    """Return name -> folder of the runs with a store: `folder` or those up to two levels down."""
    if (folder / "store").is_dir():
        return {folder.resolve().name: folder}
    found: dict[str, F] = {}
    waiting = _subfolders(folder) if folder.is_dir() else []
    while waiting:
        with_store = map_concurrently(lambda one: (one / "store").is_dir(), waiting, folder)
        found |= {str(one)[len(str(folder)) :].strip("/"): one for one in compress(waiting, with_store)}
        without = compress(waiting, map(not_, with_store))
        waiting = [child for one in without if one.parent == folder for child in _subfolders(one)]
    return dict(sorted(found.items(), key=lambda one: natural_sort_key(one[0])))


def _run_marker(folder: Folder) -> str | None:
    """Return the entry by which a folder is recognised as a run, or None."""
    if (folder / "current").is_file():
        return "current"
    return "store" if (folder / "store").is_dir() else None


def _subfolders(parent: F) -> list[F]:
    return [cast(F, path) for path in parent.iterdir() if not path.name.startswith(".") and path.is_dir()]


def publish_hint(folder: Folder, what: str) -> str:
    """Return the command that publishes what a folder lacks."""
    words = ("city", "CITY.yaml") if (folder / CITY_FILE_NAME).is_file() else ("run", "BLOCK.yaml")
    return f"`{format_command(*words, '--out', folder)}` {what}"
