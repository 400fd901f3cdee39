"""Model files of the newest published snapshot for the 3D view, and its first camera position."""

from __future__ import annotations

import json
from urllib.parse import urlencode

from catalogs.published.folders import Folder
from catalogs.published.snapshot import SnapshotFolder, find_current_snapshot
from facade_core.core.errors import InputError, StoreError
from facade_core.core.json_types import JsonObject
from tasks.viewing.run_view import RunView
from tasks.viewing.start_view import choose_start_view


def viewer_model_index(out: Folder, view: RunView) -> JsonObject:
    """Return the addresses and boxes of the newest model's tiles, of its overview, and the start of a walk.

    Returns
    -------
    index : `tiles` with boxes in world metres, `overview`, `anchor` (start in world metres) and `heading` (degrees
        clockwise from north, None without a street).

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
    start = choose_start_view(view)
    return {
        "anchor": start.position if start else listed[0]["origin"],
        "heading": start.heading if start else None,
        "overview": f"model?{urlencode({'of': snapshot.id})}",
        "tiles": [
            {
                "address": f"model?{urlencode({'of': snapshot.id, 'tile': tile['path']})}",
                "box": tile["box"],
                "origin": tile["origin"],
            }
            for tile in listed
        ],
    }


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
