"""Search of the published facades, buildings and streets of several blocks by text, from their catalogues."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catalogs.crs import LONLAT, coordinate_transform
from catalogs.published import object_store
from catalogs.published.columns import BBOX
from catalogs.published.folders import Folder
from catalogs.published.merged_items import read_merged_items_headers
from catalogs.published.snapshot import snapshot_folder
from facade_core.core.json_types import JsonObject
from tasks.viewing.city_view import CityReader, ViewedBlock

if TYPE_CHECKING:
    import pandas as pd

# Results of an answer, by kind.
MAX_FOUND = 20
_COLUMNS = ("id", "kind", "building", "street", *BBOX)


def find_in_city(reader: CityReader, text: str) -> JsonObject:
    """Find blocks, streets, buildings and facades whose name or id contains a text.

    Facades that are not published are not found. At most MAX_FOUND of each kind are returned, exact matches first.

    Parameters
    ----------
    reader : reader of the city.
    text : text to find; case does not matter.

    Returns
    -------
    found : `kind`, `id`, `block` (number), `blocks` (numbers of all blocks with it) and `box`
        [west, south, east, north] in metres from the origin of the map.
    """
    wanted = text.strip().casefold()
    if not wanted:
        return {"found": []}
    city = reader.read()
    on_map = [block for block in city.blocks.values() if block.place and block.place.crs == reader.crs]
    found = [
        {"kind": "block", "id": block.name, "blocks": [block.number], "box": _outline_box(block, reader.origin)}
        for block in on_map
        if any(wanted in name.casefold() for name in (block.name, *(block.place.streets if block.place else ())))
    ]
    hits: dict[tuple[str, str], list[tuple[int, list[float]]]] = {}
    for number, rows in _iterate_rows(reader.out, on_map):
        for kind, column in (("street", "street"), ("building", "building"), ("facade", "id")):
            mine = rows[rows[column].str.casefold().str.contains(wanted, regex=False, na=False)]
            for name, group in mine.groupby(column):
                box = [group.xmin.min(), group.ymin.min(), group.xmax.max(), group.ymax.max()]
                hits.setdefault((kind, str(name)), []).append((number, box))
    for kind in ("street", "building", "facade"):
        names = sorted((name for of, name in hits if of == kind), key=lambda name: (name.casefold() != wanted, name))
        for name in names[:MAX_FOUND]:
            parts = hits[kind, name]
            boxes = np.array([box for _, box in parts], float)
            lonlat = [*boxes[:, :2].min(axis=0), *boxes[:, 2:].max(axis=0)]
            found.append(
                {
                    "kind": kind,
                    "id": name,
                    "blocks": [number for number, _ in parts],
                    "box": _project_box(lonlat, reader.crs, reader.origin),
                }
            )
    return {"found": found}


def _iterate_rows(out: Folder, blocks: Sequence[ViewedBlock]) -> Iterator[tuple[int, pd.DataFrame]]:
    """Yield the facades of each published block, from the merged catalogues where they show its newest snapshot."""
    by_run = {str(block.folder)[len(str(out)) :].strip("/"): block for block in blocks if block.published}
    for merged in read_merged_items_headers(out):
        current = {run for run, snapshot in merged.runs.items() if run in by_run and by_run[run].published == snapshot}
        if current:
            rows = _read_facades(merged.path, [*_COLUMNS, "run"])
            for run, group in rows[rows.run.isin(current)].groupby("run"):
                yield by_run.pop(str(run)).number, group
    for block in by_run.values():
        assert block.published is not None
        try:
            yield block.number, _read_facades(snapshot_folder(block.folder, block.published).items, _COLUMNS)
        except OSError:  # pruned meanwhile; the next search reads the newer one
            continue


def _read_facades(path: Folder, columns: Iterable[str]) -> pd.DataFrame:
    import pyarrow.parquet as pq

    source, filesystem = (path, None) if isinstance(path, Path) else (path.path, object_store.arrow_filesystem())
    rows: pd.DataFrame = pq.read_table(source, columns=list(columns), filesystem=filesystem).to_pandas()
    return rows[rows.kind == "facade"]


def _outline_box(block: ViewedBlock, origin: tuple[float, float]) -> list[float]:
    assert block.place is not None
    corners = np.array(block.place.outline).reshape(-1, 2) - origin
    return [*corners.min(axis=0).tolist(), *corners.max(axis=0).tolist()] if len(corners) else []


def _project_box(box: Sequence[float], crs: str, origin: tuple[float, float]) -> list[float]:
    """Return the box in metres from the origin around a box in degrees."""
    corners = np.array([(box[i], box[j]) for i in (0, 2) for j in (1, 3)], float)
    east, north = coordinate_transform(LONLAT, crs)(*corners.T)
    low = [float(np.min(east)) - origin[0], float(np.min(north)) - origin[1]]
    high = [float(np.max(east)) - origin[0], float(np.max(north)) - origin[1]]
    return [round(value, 1) for value in (*low, *high)]
