"""STAC catalogs: catalog.json of a run and of a folder of runs."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from urllib.parse import quote

from catalogs.published.folders import Folder, write_atomically
from catalogs.published.runs import PublishedRun, find_runs, publish_hint
from catalogs.published.s3 import folder_at
from catalogs.published.snapshot import SnapshotFolder, current_snapshot
from catalogs.stac.snapshot import required_collection_files, stac_object_json
from catalogs.stac.versions import mark_superseded_snapshots
from facade_core.core.errors import InputError

CATALOG = "catalog.json"


def write_catalog(
    folder: Folder | str,
    *,
    on_left_out: Callable[[str], None] | None = None,
    find_snapshot: Callable[[Folder], SnapshotFolder[Folder]] = current_snapshot,
) -> Folder:
    """Write catalog.json of a run or of a folder of runs, atomically.

    A run's catalog has the Collections of its current snapshot as children, and STAC files of older snapshots are
    marked as deprecated. A folder's catalog has one child per run, at most two levels down; outdated catalogs of runs
    are updated.

    Parameters
    ----------
    on_left_out : called with one line for each run that is left out.
    find_snapshot : returns the published snapshot of a run; called until it returns the same twice.

    Raises
    ------
    InputError : nothing is published.
    """
    folder = folder_at(folder)
    runs, left_out = find_runs(folder)
    if runs and runs[0].folder == folder:
        _write_run_catalog(runs[0], find_snapshot)
        return folder / CATALOG
    children = []
    for run in runs:
        try:
            _write_run_catalog(run, find_snapshot)
            # folder names may contain characters that are special in links
            children.append((f"./{re.sub('[%?#]', lambda sign: quote(sign[0]), run.name)}/{CATALOG}", run.name))
        except (InputError, OSError) as error:
            left_out.append(f"{run.name} is left out: {error}")
    for line in left_out:
        if on_left_out:
            on_left_out(line)
    if not children:
        raise InputError(f"{folder}: nothing is published there; {publish_hint(folder, 'publishes')}")
    _write_catalog_file(folder, f"Runs of Streetloom in {_folder_name(folder)}", children)
    return folder / CATALOG


def _write_run_catalog(run: PublishedRun[Folder], find_snapshot: Callable[[Folder], SnapshotFolder[Folder]]) -> None:
    """Write the catalog of a run until `current` stays the same.

    Of two concurrent writers, the last one then sees the newest snapshot.
    """
    snapshot = None
    while snapshot != (snapshot := find_snapshot(run.folder)):
        collections = required_collection_files(snapshot.folder)
        missing = [path for _, path in collections if not path.is_file()]
        if missing:
            raise InputError(f"{missing[0]} is missing; {publish_hint(run.folder, 'publishes again')}")
        name = _folder_name(run.folder)
        children = [(f".{str(path)[len(str(run.folder)) :]}", kind) for kind, path in collections]
        _write_catalog_file(run.folder, f"What Streetloom published in {name}", children)
    mark_superseded_snapshots(run.folder / "published", snapshot.id)


def _write_catalog_file(folder: Folder, description: str, children: Sequence[tuple[str, str]]) -> None:
    import pystac

    catalog = pystac.Catalog(_folder_name(folder), description, title=_folder_name(folder))
    catalog.clear_links()
    catalog.add_link(pystac.Link("root", f"./{CATALOG}", "application/json"))
    catalog.add_links([pystac.Link("child", href, "application/json", title) for href, title in children])
    path, data = folder / CATALOG, stac_object_json(catalog).encode()
    if path.is_file() and path.read_bytes() == data:
        return  # allows read-only folders with an up-to-date catalog
    write_atomically(path, data)


def _folder_name(folder: Folder) -> str:
    return folder.resolve().name or "runs"
