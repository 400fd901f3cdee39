"""The textured block in 3D: which files of the newest published snapshot a page draws, and from where it looks first."""

from __future__ import annotations

import json
from typing import Any
from urllib.parse import urlencode

from catalogs.published.folders import Folder
from catalogs.published.snapshot import Snapshot, find_current_snapshot
from facade_core.core.errors import InputError, StoreError
from tasks.viewing import View
from tasks.viewing.opening import opening


def model_index(out: Folder, view: View) -> dict[str, Any]:
    """Addresses of the newest model's tiles with their boxes, world metres, and of its overview; `anchor`, the world place
    where a walk begins, and `heading`, degrees clockwise from north, None where there is no street. Raises StoreError before
    anything is published."""
    snapshot = find_current_snapshot(out)
    if snapshot is None:
        raise StoreError("nothing is published yet: the model appears at the end of the run")
    listed = json.loads(snapshot.tiles.read_text("utf-8"))["tiles"]
    if not listed:
        raise StoreError("the model has no tiles: nothing was textured; the page Run says why")
    start = opening(view)
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
    """The model of a tile of the snapshot `of`, or its overview. Raises InputError where that is not there."""
    snapshot = find_current_snapshot(out)
    if snapshot is None or snapshot.id != snapshot_id:
        raise InputError("another model was published since; load the page again")
    if tile is not None and tile not in _tile_paths(snapshot):
        raise InputError(f"the model has no tile {tile!r}")
    path = snapshot.overview if tile is None else snapshot.tile(tile)
    if not path.is_file():
        raise InputError(f"{path.name} is missing; {snapshot.remedy}")
    return path


def _tile_paths(snapshot: Snapshot) -> set[str]:
    return {tile["path"] for tile in json.loads(snapshot.tiles.read_text("utf-8"))["tiles"]}
