"""A Collection's Items as one stac-geoparquet file, so that a reader of STAC need not open each."""

from __future__ import annotations

import json
import posixpath
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

import shapely

if TYPE_CHECKING:
    from pyproj import CRS
    from pystac import Collection, Item

MIRROR = "items.parquet"
_SIDES = ("xmin", "ymin", "xmax", "ymax")
# Parquet has no struct without a field.
_NO_ASSETS = {"thumbnail": {"href": None}}


def write_mirror(path: Path, items: Sequence[tuple[str, Item]], collection: Collection, crs: CRS) -> None:
    """Write Items that have a place, given with their hrefs from the folder of `path`, and their Collection.

    Properties are columns of their own, times are times, geometries WKB (proj:geometry in `crs`); hrefs of links and assets
    lead on from the file's folder. Without Items the file has no rows, and `id` is its one column.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    rows = [_row(href, item) for href, item in items]
    names = dict.fromkeys(name for row in rows for name in row) or {"id": None}
    table = pa.table({name: [row.get(name) for row in rows] for name in names})
    boxes = [row["bbox"] for row in rows]
    geometry: dict[str, Any] = {"encoding": "WKB", "geometry_types": _types(rows, "geometry")}
    if boxes:
        ends = zip(_SIDES, (min, min, max, max), strict=True)
        geometry |= {
            "bbox": [extreme(box[side] for box in boxes) for side, extreme in ends],
            "covering": {"bbox": {side: ["bbox", side] for side in _SIDES}},
        }
    own = {"encoding": "WKB", "geometry_types": _types(rows, "proj:geometry"), "crs": crs.to_json_dict()}
    columns = {"geometry": geometry, "proj:geometry": own}
    geo = {"version": "1.1.0", "primary_column": "geometry", "columns": columns}
    said = collection.to_dict(include_self_link=False, transform_hrefs=False)
    header = ({"geo": geo} if rows else {}) | {
        "stac:collection": said,
        "stac-geoparquet": {"version": "1.0.0", "collections": {collection.id: said}},
    }
    pq.write_table(
        table.replace_schema_metadata({k: json.dumps(v) for k, v in header.items()}), path, compression="zstd"
    )


def without_links(mirror: bytes, dead: Callable[[dict[str, Any]], bool]) -> bytes | None:
    """A mirror without some links of its Items and its Collection; None where it has none of these."""
    import io

    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pq.read_table(io.BytesIO(mirror))
    header = {key: json.loads(text) for key, text in (table.schema.metadata or {}).items() if key != b"ARROW:schema"}
    found = False

    def living(links: list[dict[str, Any]]) -> list[dict[str, Any]]:
        nonlocal found
        kept = [link for link in links if not dead(link)]
        found = found or len(kept) < len(links)
        return kept

    for said in (header[b"stac:collection"], *header[b"stac-geoparquet"]["collections"].values()):
        said["links"] = living(said["links"])
    if "links" in table.column_names:
        column = table.column_names.index("links")
        links = [living(row) for row in table["links"].to_pylist()]
        table = table.set_column(column, table.schema.field("links"), pa.array(links, table.schema.field("links").type))
    if not found:
        return None
    table = table.replace_schema_metadata({key: json.dumps(value) for key, value in header.items()})
    made = io.BytesIO()
    pq.write_table(table, made, compression="zstd")
    return made.getvalue()


def _row(href: str, item: Item) -> dict[str, Any]:
    fields = item.to_dict(include_self_link=False, transform_hrefs=False)
    folder = str(PurePosixPath(href).parent)
    properties: Mapping[str, Any] = fields["properties"]
    return {
        "id": fields["id"],
        "stac_version": fields["stac_version"],
        "stac_extensions": fields["stac_extensions"],
        "collection": fields["collection"],
        "geometry": shapely.to_wkb(shapely.geometry.shape(fields["geometry"])),
        "bbox": dict(zip(_SIDES, fields["bbox"], strict=True)),
        "links": [_moved(link, folder) for link in fields["links"]],
        "assets": {key: _moved(asset, folder) for key, asset in fields["assets"].items()} or _NO_ASSETS,
        **properties,
        "datetime": item.datetime,
        "proj:geometry": shapely.to_wkb(shapely.geometry.shape(properties["proj:geometry"])),
    }


def _moved(thing: Mapping[str, Any], folder: str) -> dict[str, Any]:
    """A link or an asset of a file in `folder` as one of the folder above leads there."""
    return {**thing, "href": posixpath.normpath(posixpath.join(folder, thing["href"]))}


def _types(rows: Sequence[Mapping[str, Any]], column: str) -> list[str]:
    return sorted({shapely.from_wkb(row[column]).geom_type for row in rows})
