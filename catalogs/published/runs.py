"""Runs that have published, in a folder on this machine or in a bucket."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, cast

from catalogs.features import natural_sort_key
from catalogs.published.folders import F, Folder, each
from facade_core.core.errors import InputError

# In a city's folder, from its first minute on: of which blocks it is.
CITY = "city.json"


@dataclass(frozen=True)
class Run(Generic[F]):
    """A run's folder and its name: relative to the folder of runs that was asked for, else the folder's own."""

    folder: F
    name: str


def runs_in(folder: F) -> tuple[list[Run[F]], list[str]]:
    """The runs that have published, and a line about each that has not: `folder` itself, else those at most two levels down.

    A run is known by its `current`, or by its store before it has published, and is not searched for others. Raises
    InputError where there is no run that has published.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; {publishes(folder, 'makes it')}")
    if (folder / "current").is_file():
        return [Run(folder, folder.resolve().name)], []
    runs: list[Run[F]] = []
    left_out: list[str] = []
    waiting = [folder]
    while waiting:
        parent = waiting.pop()
        try:
            children = sorted(_folders(parent), key=str)
            for child, holds in zip(children, each(_holds, children, folder), strict=True):
                name = str(child)[len(str(folder)) :].strip("/")
                if holds == "current":
                    runs.append(Run(child, name))
                elif holds == "store":
                    left_out.append(f"{name} is left out: nothing is published there yet")
                elif parent == folder:
                    waiting.append(child)
        except OSError as error:
            left_out.append(f"{parent} is left out: {error.strerror}")
    if not runs:
        raise InputError(f"{folder}: nothing is published there; {publishes(folder, 'finishes and publishes')}")
    runs.sort(key=lambda run: natural_sort_key(run.name))
    return runs, sorted(left_out, key=natural_sort_key)


def stores_in(folder: F) -> dict[str, F]:
    """The runs that have a store, published or not, by name: `folder` itself, else those at most two levels down."""
    if (folder / "store").is_dir():
        return {folder.resolve().name: folder}
    found: dict[str, F] = {}
    waiting = _folders(folder) if folder.is_dir() else []
    while waiting:
        with_store = each(lambda one: (one / "store").is_dir(), waiting, folder)
        found |= {
            str(one)[len(str(folder)) :].strip("/"): cast(F, one)
            for one, is_run in zip(waiting, with_store, strict=True)
            if is_run
        }
        without = [one for one, is_run in zip(waiting, with_store, strict=True) if not is_run]
        waiting = [child for one in without if one.parent == folder for child in _folders(one)]
    return dict(sorted(found.items(), key=lambda one: natural_sort_key(one[0])))


def _holds(folder: Folder) -> str | None:
    """By what a run is known, as far as it has come."""
    if (folder / "current").is_file():
        return "current"
    return "store" if (folder / "store").is_dir() else None


def _folders(parent: F) -> list[F]:
    return [cast(F, path) for path in parent.iterdir() if not path.name.startswith(".") and path.is_dir()]


def publishes(folder: Folder, what: str) -> str:
    """What to do where a folder lacks what a run, or that of a city, publishes."""
    return f"`streetloom {'city CITY' if (folder / CITY).is_file() else 'run BLOCK'}.yaml --out {folder}` {what}"
