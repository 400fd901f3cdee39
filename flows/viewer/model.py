"""Model files of the newest published snapshot for the 3D view, and the start of a walk."""

from __future__ import annotations

import json
from urllib.parse import urlencode

from catalogs.published.folders import Folder, file_size
from catalogs.published.snapshot import SnapshotFolder, find_current_snapshot
from facade_core.core.errors import InputError, StoreError
from facade_core.core.json_types import JsonObject
from tasks.viewing.run_view import RunView
from tasks.viewing.start_view import choose_start_view


def viewer_model_index(out: Folder) -> JsonObject:
    """Return the addresses and boxes of the newest model's tiles and of its overview.

    Returns
    -------
    index : `tiles` with boxes in world metres and sizes in bytes, and `overview`.

    Raises
    ------
    StoreError
        Nothing is published yet.
    """
    snapshot = find_current_snapshot(out)
    if snapshot is None:
        raise StoreError("nothing is published yet: the model appears at the end of the run")
    listed = json.loads(snapshot.tiles.read_text("utf-8"))["tiles"]
    if not listed:
        raise StoreError("the model has no tiles: nothing was textured; the page Run says why")
    return {
        "overview": {"address": f"model?{urlencode({'of': snapshot.id})}", "bytes": file_size(snapshot.overview) or 0},
        "tiles": [
            {
                "address": f"model?{urlencode({'of': snapshot.id, 'tile': tile['path']})}",
                "box": tile["box"],
                "origin": tile["origin"],
                "bytes": tile["bytes"],
            }
            for tile in listed
        ],
    }


def viewer_start(view: RunView) -> JsonObject:
    """Return the start of a walk: `anchor` in world metres and `heading` in degrees clockwise from north.

    Both are None where no street sees a facade.
    """
    start = choose_start_view(view)
    return {"anchor": start.position if start else None, "heading": start.heading if start else None}


def find_model_file(out: Folder, snapshot_id: str, tile: str | None) -> Folder:
    """Return the model file of a tile of a snapshot, or its overview.

    Raises
    ------
    InputError
        The snapshot is not the newest, or the file is missing.
    """
    snapshot = find_current_snapshot(out)
    if snapshot is None or snapshot.id != snapshot_id:
        raise InputError("another model was published since; load the page again")
    if tile is not None and tile not in _tile_paths(snapshot):
        raise InputError(f"the model has no tile {tile!r}")
    path = snapshot.overview if tile is None else snapshot.tile(tile)
    if not path.is_file():
        raise InputError(f"{path.name} is missing; {snapshot.remedy}")
    return path


def _tile_paths(snapshot: SnapshotFolder[Folder]) -> set[str]:
    return {tile["path"] for tile in json.loads(snapshot.tiles.read_text("utf-8"))["tiles"]}
