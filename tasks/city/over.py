"""What lies over all blocks of a city: one tileset, one overview, one catalogue, each of what the blocks published last."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from catalogs.published.joined import FOLDER as JOINED
from catalogs.published.joined import join_runs
from catalogs.published.runs import Run
from catalogs.published.snapshot import Snapshot, current_if_any
from catalogs.stac.catalog import CATALOG, write_catalog
from facade_core.errors import InputError
from facade_core.export.joined import join_glbs, part_of_file
from tasks.city.account import BLOCKS, OF_BLOCK

TILESET, OVERVIEW = "tileset.json", "overview.glb"
# The overview is written where it has no more bytes than this; viewers can take those of the blocks one by one.
OVERVIEW_BYTES = 512_000_000


def write_over(out: Path, names: Sequence[str], note: Callable[[str], None]) -> bool:
    """Write out/catalog.json, out/items/, out/tileset.json and out/overview.glb of the blocks that have published, each in one
    step.

    note: is told of what cannot be written or is left out, in a line each: no block waits for that. Returns whether all
    could be written.
    """
    found = [(out / BLOCKS / name, current_if_any(out / BLOCKS / name)) for name in names]
    published = [(folder, snapshot) for folder, snapshot in found if snapshot is not None]
    folders = [folder for folder, _ in published]
    runs = [(Run(folder, f"{BLOCKS}/{folder.name}"), snapshot.id) for folder, snapshot in published]
    steps: list[tuple[str, Callable[[], object]]] = [
        (CATALOG, lambda: write_catalog(out, note=lambda line: None)),
        (JOINED, lambda: join_runs(out, runs)),
        (TILESET, lambda: _write_tileset(out, [one / OF_BLOCK for one in folders if (one / OF_BLOCK).is_file()])),
        (OVERVIEW, lambda: _write_overview(out, [snapshot for _, snapshot in published], note)),
    ]
    whole = True
    for name, write in steps if folders else ():
        try:
            write()
        except (InputError, OSError, ValueError, KeyError) as error:
            note(f"{out / name} is not written ({' '.join(str(error).split())[:200]}); the next run tries again")
            whole = False
    return whole


def _write_tileset(out: Path, tilesets: Sequence[Path]) -> None:
    """A root over the tilesets of blocks: each is loaded when it is in sight."""
    children, spheres = [], []
    for path in tilesets:
        tileset = json.loads(path.read_text(encoding="utf-8"))
        sphere = _sphere(tileset["root"])
        spheres.append(sphere)
        children.append(
            {
                "boundingVolume": {"sphere": sphere.tolist()},
                "geometricError": tileset["geometricError"],
                "content": {"uri": path.relative_to(out).as_posix()},
            }
        )
    if not children:
        return
    found = np.array(spheres)
    centre = (found[:, :3].min(axis=0) + found[:, :3].max(axis=0)) / 2
    radius = float((np.linalg.norm(found[:, :3] - centre, axis=1) + found[:, 3]).max())
    root = {
        "boundingVolume": {"sphere": [*centre.tolist(), radius]},
        "geometricError": 2 * radius,
        "refine": "ADD",
        "children": children,
    }
    tileset = {"asset": {"version": "1.1"}, "geometricError": 4 * radius, "root": root}
    temporary = out / f".{TILESET}.tmp"
    temporary.write_text(json.dumps(tileset, indent=1) + "\n", encoding="utf-8")
    os.replace(temporary, out / TILESET)


def _sphere(root: dict[str, Any]) -> np.ndarray:
    """The sphere around a tileset's root, (x, y, z, radius), metres on the earth: its box under its transform, which turns and
    moves."""
    box = np.array(root["boundingVolume"]["box"], float)
    transform = np.array(root.get("transform", np.eye(4).reshape(-1)), float).reshape(4, 4).T
    centre = (transform @ np.append(box[:3], 1.0))[:3]
    return np.append(centre, np.linalg.norm(box[3:].reshape(3, 3).sum(axis=0)))


def _write_overview(out: Path, snapshots: Sequence[Snapshot[Path]], note: Callable[[str], None]) -> None:
    """The overviews of all blocks as one model, around the first one's origin."""
    files = [snapshot.overview for snapshot in snapshots if snapshot.overview.is_file()]
    if sum(file.stat().st_size for file in files) > OVERVIEW_BYTES:
        note(f"{OVERVIEW} would be too large: {TILESET} leads to the blocks")
        return
    parts = [part_of_file(file) for file in files]
    extras = [part.document["scenes"][0]["extras"] for part in parts]
    if parts:
        join_glbs(out / OVERVIEW, parts, extras[0]["origin"], extras={"crs": extras[0]["crs"]})
