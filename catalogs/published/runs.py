"""Runs that have published, in a folder on this machine or in a bucket."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, cast

from catalogs.features import natural_order
from catalogs.published.places import F, Folder
from facade_core.errors import InputError


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
            for child in sorted(_folders(parent), key=str):
                name = str(child)[len(str(folder)) :].strip("/")
                if (child / "current").is_file():
                    runs.append(Run(child, name))
                elif (child / "store").is_dir():
                    left_out.append(f"{name} is left out: nothing is published there yet")
                elif parent == folder:
                    waiting.append(child)
        except OSError as error:
            left_out.append(f"{parent} is left out: {error.strerror}")
    if not runs:
        raise InputError(f"{folder}: nothing is published there; {publishes(folder, 'finishes and publishes')}")
    runs.sort(key=lambda run: natural_order(run.name))
    return runs, sorted(left_out, key=natural_order)


def _folders(parent: F) -> list[F]:
    return [cast(F, path) for path in parent.iterdir() if not path.name.startswith(".") and path.is_dir()]


def publishes(folder: Folder, what: str) -> str:
    """What to do where a folder lacks what a run publishes."""
    return f"`streetloom run BLOCK.yaml --out {folder}` {what}"
