"""Models of the newest published snapshot as 3D Tiles for the 3D view, and the start of a walk."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence

from catalogs.published.folders import Folder
from catalogs.published.snapshot import SnapshotFolder, find_current_snapshot
from facade_core.core.errors import InputError, StoreError
from facade_core.core.json_types import JsonObject
from tasks.viewing.run_view import RunView
from tasks.viewing.start_view import choose_start_view

# Metres of a texel that are assumed of the overview and of tiles: a client loads a tile where the overview is too coarse.
OVERVIEW_TEXEL_M, TILE_TEXEL_M = 0.2, 0.06
OVERVIEW = "overview.glb"
SURROUNDINGS = "surroundings.glb"
# Cell of the grid, and its part in the quadtree, as facade_core.export.tiles.quadtree names them.
_TILE_PATH = re.compile(r"-?[0-9]{1,12}_-?[0-9]{1,12}(_[0-3]{1,60})?")


def block_tileset(out: Folder, snapshot_id: str) -> JsonObject:
    """Return the tileset (3D Tiles 1.1) of a snapshot's model: its overview, and the tiles that refine it.

    Boxes are in world metres, z up. A model's own place is the `origin` of its scene, not a transform of its tile.

    Parameters
    ----------
    out : folder of the run.
    snapshot_id : id of the newest snapshot.

    Raises
    ------
    InputError
        The snapshot is not the newest.
    StoreError
        The model has no tiles.
    """
    snapshot = _newest_snapshot(out, snapshot_id)
    listed = _read_tiles(snapshot)
    lows, highs = zip(*(tile["box"] for tile in listed), strict=True)
    low, high = (
        [min(values) for values in zip(*lows, strict=True)],
        [max(values) for values in zip(*highs, strict=True)],
    )
    return {
        # drawn from any distance, and met by no walker: no tile
        "asset": {
            "version": "1.1",
            "extras": {"surroundings": SURROUNDINGS if snapshot.surroundings.is_file() else ""},
        },
        "geometricError": 2 * OVERVIEW_TEXEL_M,
        "root": {
            "boundingVolume": {"box": _bounding_box(low, high)},
            "geometricError": OVERVIEW_TEXEL_M,
            "refine": "ADD",  # a client hides the overview where all of its tiles are shown
            "content": {"uri": OVERVIEW},
            "children": [
                {
                    "boundingVolume": {"box": _bounding_box(*tile["box"])},
                    "geometricError": TILE_TEXEL_M,
                    "content": {"uri": f"{tile['path']}.glb"},
                }
                for tile in listed
            ],
        },
    }


def viewer_start(view: RunView) -> JsonObject:
    """Return the start of a walk: `anchor` in world metres and `heading` in degrees clockwise from north.

    Where no street sees a facade, the anchor is that of the first tile, and the heading None.
    """
    if start := choose_start_view(view):
        return {"anchor": start.position, "heading": start.heading}
    return {"anchor": _read_tiles(_newest_snapshot(view.out))[0]["origin"], "heading": None}


def find_model_file(out: Folder, snapshot_id: str, name: str) -> Folder:
    """Return the file of a model that the tileset of a snapshot names.

    Raises
    ------
    InputError
        The snapshot is not the newest, or the file is missing.
    """
    snapshot = _newest_snapshot(out, snapshot_id)
    tile = name.removesuffix(".glb")
    models = {OVERVIEW: snapshot.overview, SURROUNDINGS: snapshot.surroundings}
    if name not in models and tile not in {listed["path"] for listed in _read_tiles(snapshot)}:
        raise InputError(f"the model has no tile {tile!r}")
    path = models.get(name) or snapshot.tile(tile)
    if not path.is_file():
        raise InputError(f"{path.name} is missing; {snapshot.remedy}")
    return path


def _newest_snapshot(out: Folder, snapshot_id: str | None = None) -> SnapshotFolder[Folder]:
    snapshot = find_current_snapshot(out)
    if snapshot is None:
        raise StoreError("nothing is published yet: the model appears at the end of the run")
    if snapshot_id not in (None, snapshot.id):
        raise InputError("another model was published since; load the page again")
    return snapshot


def _read_tiles(snapshot: SnapshotFolder[Folder]) -> list[JsonObject]:
    listed: list[JsonObject] = json.loads(snapshot.tiles.read_text("utf-8"))["tiles"]
    if not listed:
        raise StoreError("the model has no tiles: nothing was textured; the page Run says why")
    for tile in listed:
        if not _TILE_PATH.fullmatch(str(tile["path"])):
            raise InputError(f"tiles/index.json names {tile['path']!r}, which is no tile; {snapshot.remedy}")
    return listed


def _bounding_box(low: Sequence[float], high: Sequence[float]) -> list[float]:
    """Return a box of 3D Tiles: its centre, and half of each side as a vector."""
    (x, y, z), (a, b, c) = zip(*(((p + q) / 2, (q - p) / 2) for p, q in zip(low, high, strict=True)), strict=True)
    return [x, y, z, a, 0, 0, 0, b, 0, 0, 0, c]
