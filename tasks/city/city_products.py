"""Products of a whole city: tileset, overview model and catalogue over the blocks' newest snapshots."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from catalogs.published import object_store
from catalogs.published.folders import Folder, file_size, local_run_folder, map_concurrently, write_atomically
from catalogs.published.merged_items import ITEMS_FOLDER as JOINED
from catalogs.published.merged_items import merge_run_items
from catalogs.published.runs import PublishedRun
from catalogs.published.snapshot import SnapshotFolder, find_current_snapshot
from catalogs.stac.catalog import CATALOG, write_catalog
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject
from facade_core.export.models.glb_merge import merge_glbs, read_glb_file_header
from facade_core.export.tiles.city_tileset import build_city_tileset, refer_to_tileset
from tasks.city.city_log import BLOCKS_FOLDER, block_tileset_path

TILESET = "tileset.json"
OVERVIEW = "overview.glb"
# A larger overview is not written; viewers can load those of the blocks.
MAX_OVERVIEW_BYTES = 512_000_000


def write_city_products(out: Folder, names: Sequence[str], note: Callable[[str], None]) -> bool:
    """Write out/catalog.json, out/items/, out/tileset.json and out/overview.glb of the blocks.

    Only blocks that have published take part. Each product is written atomically.

    Parameters
    ----------
    out : folder of the city.
    names : names of the blocks.
    note : receives one line for each product that cannot be written or is omitted. No block waits for that.

    Returns
    -------
    True if every product could be written.
    """
    snapshots = map_concurrently(lambda name: find_current_snapshot(out / BLOCKS_FOLDER / name), names, out)
    published = [(name, snapshot) for name, snapshot in zip(names, snapshots, strict=True) if snapshot is not None]
    runs = [(PublishedRun(snapshot.out, f"{BLOCKS_FOLDER}/{name}"), snapshot.id) for name, snapshot in published]
    steps: list[tuple[str, Callable[[], object]]] = [
        (CATALOG, lambda: write_catalog(out, on_left_out=lambda line: None)),
        (JOINED, lambda: merge_run_items(out, runs)),
        (
            TILESET,
            lambda: _write_tileset(out, [block_tileset_path(snapshot.out, snapshot.id) for _, snapshot in published]),
        ),
        (OVERVIEW, lambda: _write_overview(out, [snapshot for _, snapshot in published], note)),
    ]
    whole = True
    for name, write in steps if published else ():
        try:
            write()
        except (InputError, OSError, ValueError, KeyError) as error:
            note(f"{out / name} is not written ({' '.join(str(error).split())[:200]}); the next run tries again")
            whole = False
    return whole


def _write_tileset(out: Folder, paths: Sequence[Folder]) -> None:
    """Write a root tileset that refers to the blocks' tilesets, which clients load when in view."""
    references = [
        refer_to_tileset(str(path)[len(str(out)) :].strip("/"), tileset)
        for path, tileset in zip(paths, map_concurrently(_read_tileset, paths, out), strict=True)
        if tileset is not None
    ]
    if references:
        write_atomically(out / TILESET, (json.dumps(build_city_tileset(references), indent=1) + "\n").encode())


def _read_tileset(path: Folder) -> JsonObject | None:
    """Load a block's tileset; None if it has none."""
    try:
        tileset: JsonObject = json.loads(path.read_text(encoding="utf-8"))
        return tileset
    except FileNotFoundError:
        return None


def _write_overview(out: Folder, snapshots: Sequence[SnapshotFolder[Folder]], note: Callable[[str], None]) -> None:
    """Merge the blocks' overview models into one, around the first one's origin."""
    sizes = map_concurrently(lambda snapshot: file_size(snapshot.overview), snapshots, out)
    files = [snapshot.overview for snapshot, size in zip(snapshots, sizes, strict=True) if size is not None]
    if sum(filter(None, sizes)) > MAX_OVERVIEW_BYTES:
        note(f"{OVERVIEW} would be too large: {TILESET} leads to the blocks")
        return
    with tempfile.TemporaryDirectory(dir=local_run_folder(out), prefix=f".{OVERVIEW}.") as name:
        parts = [
            read_glb_file_header(file)
            for file in map_concurrently(lambda file: _local_copy(file, Path(name)), files, out)
        ]
        extras = [part.document["scenes"][0]["extras"] for part in parts]
        if parts:
            model = out / OVERVIEW if isinstance(out, Path) else Path(name) / OVERVIEW
            merge_glbs(model, parts, extras[0]["origin"], extras={"crs": extras[0]["crs"]})
            if not isinstance(out, Path):
                object_store.upload_object((out / OVERVIEW).path, model)


def _local_copy(file: Folder, folder: Path) -> Path:
    """Return a local path of a block's overview; downloads it from a bucket."""
    if isinstance(file, Path):
        return file
    target = folder / f"{file.parent.parent.parent.name}.glb"
    target.write_bytes(file.read_bytes())
    return target
