"""Folder that `streetloom view` opens: a run, a city, or several runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from catalogs.published.folders import Folder

# Runs that an error names.
MAX_NAMED_RUNS = 8


@dataclass(frozen=True)
class ViewedFolder:
    """Folder that the viewer opens.

    Attributes
    ----------
    folder : folder of a run, of a city, or of several runs.
    is_city : it has blocks, each with a run of its own.
    first_run : a run in it; None where none has begun.
    """

    folder: Folder
    is_city: bool
    first_run: Folder | None


def find_viewed_folder(folder: Folder, *, several: bool) -> ViewedFolder:
    """Return the run or the city in `folder`; with `several`, a folder of several runs too.

    Raises
    ------
    InputError
        There is none, or there are several and one is needed.
    """
    from catalogs.published.runs import find_runs_with_store
    from tasks.viewing.city_view import is_city

    if not several:
        run = find_single_run(folder)
        return ViewedFolder(run, False, run)
    runs = find_runs_with_store(folder)
    if len(runs) > 1 or is_city(folder):
        return ViewedFolder(folder, True, next(iter(runs.values()), None))
    cities = [] if runs or not folder.is_dir() else [child for child in folder.iterdir() if is_city(child)]
    if len(cities) == 1:
        return find_viewed_folder(cities[0], several=True)
    run = find_single_run(folder)
    return ViewedFolder(run, False, run)


def find_single_run(folder: Folder) -> Folder:
    """Return the folder of the single run in `folder`, at most two levels down, finished or in progress.

    Raises
    ------
    InputError
        There are several runs, which the message names, or none.
    """
    from catalogs.printable_text import format_command
    from catalogs.published.runs import find_runs_with_store
    from catalogs.published.s3 import S3Path
    from facade_core.core.errors import InputError
    from flows.lock import is_locked

    found = list(find_runs_with_store(folder).items())
    if not found:
        if isinstance(folder, S3Path):
            raise InputError(
                f"{folder}: no run has written there; name what `streetloom run --out` named, or start the run"
            )
        locks = [folder / ".lock", *(lock for pattern in ("*/.lock", "*/*/.lock") for lock in folder.glob(pattern))]
        for begun in (lock.parent for lock in locks if is_locked(lock.parent)):
            raise InputError(
                f"{begun}: a run has just begun here and has no store yet; wait until it has ingested its block, then: "
                f"{format_command('view', begun)}"
            )
        raise InputError(
            f"{folder}: no run has written here; name the folder that `streetloom run --out` wrote, or start the run"
        )
    if len(found) > 1:
        names = ", ".join(name for name, _ in found[:MAX_NAMED_RUNS])
        more = f" and {len(found) - MAX_NAMED_RUNS} more" if len(found) > MAX_NAMED_RUNS else ""
        raise InputError(
            f"{folder}: holds {len(found)} runs ({names}{more}); open one: {format_command('view', found[0][1])}"
        )
    return found[0][1]
