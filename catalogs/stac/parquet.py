"""Items of a Collection as one stac-geoparquet file, so that readers need not open each Item."""

from __future__ import annotations

import json
import posixpath
from collections.abc import Callable, Sequence
from itertools import chain
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

import shapely

from catalogs.published.columns import BBOX
from facade_core.core.json_types import JsonObject

if TYPE_CHECKING:
    from pyproj import CRS
    from pystac import Collection, Item

MIRROR_NAME = "items.parquet"
# Parquet has no empty structs.
_NO_ASSETS = {"thumbnail": {"href": None}}


def write_stac_geoparquet(path: Path, items: Sequence[tuple[str, Item]], collection: Collection, crs: CRS) -> None:
    """Write the Items of a Collection that have a place as one stac-geoparquet file.

    Properties are columns, times are times, geometries are WKB (proj:geometry in `crs`). Links and assets are
    relative to the file's folder. Without Items the file has no rows, and `id` is its only column.

    Parameters
    ----------
    items : Items with their hrefs from the folder of `path`.
    collection : Collection of the Items.
    crs : frame of proj:geometry.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    rows = [_item_row(href, item) for href, item in items]
    names = dict.fromkeys(chain.from_iterable(rows)) or {"id": None}
    table = pa.table({name: [row.get(name) for row in rows] for name in names})
    boxes = [row["bbox"] for row in rows]
    geometry: JsonObject = {"encoding": "WKB", "geometry_types": _geometry_types(rows, "geometry")}
    if boxes:
        ends = zip(BBOX, (min, min, max, max), strict=True)
        geometry |= {
            "bbox": [extreme(box[side] for box in boxes) for side, extreme in ends],
            "covering": {"bbox": {side: ["bbox", side] for side in BBOX}},
        }
    own = {"encoding": "WKB", "geometry_types": _geometry_types(rows, "proj:geometry"), "crs": crs.to_json_dict()}
    columns = {"geometry": geometry, "proj:geometry": own}
    geo = {"version": "1.1.0", "primary_column": "geometry", "columns": columns}
    collection_fields = collection.to_dict(include_self_link=False, transform_hrefs=False)
    header = ({"geo": geo} if rows else {}) | {
        "stac:collection": collection_fields,
        "stac-geoparquet": {"version": "1.0.0", "collections": {collection.id: collection_fields}},
    }
    pq.write_table(
        table.replace_schema_metadata({k: json.dumps(v) for k, v in header.items()}), path, compression="zstd"
    )


def remove_dead_geoparquet_links(mirror: bytes, is_dead: Callable[[JsonObject], bool]) -> bytes | None:
    """Return a stac-geoparquet file without the dead links of its Items and Collection; None if it has none."""
    import io

    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pq.read_table(io.BytesIO(mirror))
    header = {key: json.loads(text) for key, text in (table.schema.metadata or {}).items() if key != b"ARROW:schema"}
    found = False

    def keep_living(links: list[JsonObject]) -> list[JsonObject]:
        nonlocal found
        kept = [link for link in links if not is_dead(link)]
        found = found or len(kept) < len(links)
        return kept

    for collection_fields in (header[b"stac:collection"], *header[b"stac-geoparquet"]["collections"].values()):
        collection_fields["links"] = keep_living(collection_fields["links"])
    if "links" in table.column_names:
        column = table.column_names.index("links")
        links = [keep_living(row) for row in table["links"].to_pylist()]
        table = table.set_column(column, table.schema.field("links"), pa.array(links, table.schema.field("links").type))
    if not found:
        return None
    table = table.replace_schema_metadata({key: json.dumps(value) for key, value in header.items()})
    buffer = io.BytesIO()
    pq.write_table(table, buffer, compression="zstd")
    return buffer.getvalue()


def _item_row(href: str, item: Item) -> JsonObject:
    fields = item.to_dict(include_self_link=False, transform_hrefs=False)
    folder = str(PurePosixPath(href).parent)
    properties: JsonObject = fields["properties"]
    return {
        "id": fields["id"],
        "stac_version": fields["stac_version"],
        "stac_extensions": fields["stac_extensions"],
        "collection": fields["collection"],
        "geometry": shapely.to_wkb(shapely.geometry.shape(fields["geometry"])),
        "bbox": dict(zip(BBOX, fields["bbox"], strict=True)),
        "links": [_rebase_href(link, folder) for link in fields["links"]],
        "assets": {key: _rebase_href(asset, folder) for key, asset in fields["assets"].items()} or _NO_ASSETS,
        **properties,
        "datetime": item.datetime,
        "proj:geometry": shapely.to_wkb(shapely.geometry.shape(properties["proj:geometry"])),
    }


def _rebase_href(thing: JsonObject, folder: str) -> JsonObject:
    """Return a link or an asset of a file in `folder` as seen from the folder above."""
    return {**thing, "href": posixpath.normpath(posixpath.join(folder, thing["href"]))}


def _geometry_types(rows: Sequence[JsonObject], column: str) -> list[str]:
    return sorted({shapely.from_wkb(row[column]).geom_type for row in rows})
