"""catalog.json of a run, which leads to what is published there, and of a folder of runs, which leads to theirs."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from urllib.parse import quote

from catalogs.published.folders import Folder, put
from catalogs.published.runs import Run, publishes, runs_in
from catalogs.published.s3 import folder_at
from catalogs.published.snapshot import Snapshot, current
from catalogs.stac.snapshot import collections_in, to_json
from catalogs.stac.versions import supersede
from facade_core.core.errors import InputError

CATALOG = "catalog.json"


def write_catalog(
    folder: Folder | str,
    *,
    note: Callable[[str], None] | None = None,
    newest: Callable[[Folder], Snapshot] = current,
) -> Folder:
    """Write folder/catalog.json, of a run or of a folder of runs, in one step: a reader sees the old file or the new one.

    A run's has the Collections as children that `current` leads to, and the STAC files of older snapshots are marked as
    deprecated. A folder's has one child per run in it, at most two levels down: the run's own catalog.json, which is mended
    where it is missing or old.

    Args:
        note: is told of each run that is left out, in one line.
        newest: says which snapshot of a run is published, and is asked until it says the same twice.

    Raises InputError where nothing is published.
    """
    folder = folder_at(folder)
    runs, left_out = runs_in(folder)
    if runs and runs[0].folder == folder:
        _write_run(runs[0], newest)
        return folder / CATALOG
    children = []
    for run in runs:
        try:
            _write_run(run, newest)
            # a run's folder may have a name that means something in a link
            children.append((f"./{re.sub('[%?#]', lambda sign: quote(sign[0]), run.name)}/{CATALOG}", run.name))
        except (InputError, OSError) as error:
            left_out.append(f"{run.name} is left out: {error}")
    for line in left_out:
        if note:
            note(line)
    if not children:
        raise InputError(f"{folder}: nothing is published there; {publishes(folder, 'publishes')}")
    _write(folder, f"Runs of Streetloom in {_name(folder)}", children)
    return folder / CATALOG


def _write_run(run: Run, newest: Callable[[Folder], Snapshot]) -> None:
    """Until `current` stays: of two that write at once, the last sees the newest snapshot."""
    snapshot = None
    while snapshot != (snapshot := newest(run.folder)):
        collections = collections_in(snapshot.folder)
        missing = [path for _, path in collections if not path.is_file()]
        if missing:
            raise InputError(f"{missing[0]} is missing; `streetloom run BLOCK.yaml --out {run.folder}` publishes again")
        name = _name(run.folder)
        children = [(f".{str(path)[len(str(run.folder)) :]}", kind) for kind, path in collections]
        _write(run.folder, f"What Streetloom published in {name}", children)
    supersede(run.folder / "published", snapshot.id)


def _write(folder: Folder, description: str, children: Sequence[tuple[str, str]]) -> None:
    import pystac

    catalog = pystac.Catalog(_name(folder), description, title=_name(folder))
    catalog.clear_links()
    catalog.add_link(pystac.Link("root", f"./{CATALOG}", "application/json"))
    catalog.add_links([pystac.Link("child", href, "application/json", title) for href, title in children])
    path, data = folder / CATALOG, to_json(catalog).encode()
    if path.is_file() and path.read_bytes() == data:
        return  # a folder that cannot be written to may be catalogued all the same
    put(path, data)


def _name(folder: Folder) -> str:
    return folder.resolve().name or "runs"
