"""Layers of a map as GeoParquet files, with a row group for each block."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from facade_core.core.json_types import JsonObject

if TYPE_CHECKING:
    import geopandas as gpd
    import pandas as pd

COMPRESSION: Literal["zstd"] = "zstd"


def encode_layer(layer: gpd.GeoDataFrame | pd.DataFrame) -> bytes:
    """Encode a layer as a file in memory; one without geometry becomes plain Parquet."""
    buffer = io.BytesIO()
    layer.to_parquet(buffer, index=False, compression=COMPRESSION)
    return buffer.getvalue()


def write_geoparquet(path: Path, encoded: Sequence[bytes | Path], metadata: Mapping[str, str]) -> None:
    """Write encoded tables of one layer into a file, a row group each; they have the same columns.

    Parameters
    ----------
    path : file to write.
    encoded : tables as `encode_layer` gives them, or files of those.
    metadata : metadata of the file.
    """
    import pyarrow.parquet as pq

    geometry: JsonObject | None = None
    for one in encoded:
        stated = (pq.read_schema(_source(one)).metadata or {}).get(b"geo")
        geometry = _merge_geometry(geometry, json.loads(stated)) if stated else geometry
    about = {**metadata, **({"geo": json.dumps(geometry)} if geometry else {})}
    schema = pq.read_schema(_source(encoded[0])).with_metadata(about)
    with pq.ParquetWriter(path, schema, compression=COMPRESSION) as writer:
        for one in encoded:
            writer.write_table(pq.read_table(_source(one)).cast(schema))


def _source(encoded: bytes | Path) -> io.BytesIO | Path:
    return io.BytesIO(encoded) if isinstance(encoded, bytes) else encoded


def _merge_geometry(before: JsonObject | None, geometry: JsonObject) -> JsonObject:
    """Merge the GeoParquet headers of two tables of one layer: extent and types of geometries."""
    if before is None:
        return geometry
    one, two = (part["columns"][part["primary_column"]] for part in (before, geometry))
    merged = {**one, "geometry_types": sorted({*one["geometry_types"], *two["geometry_types"]})}
    if "bbox" in one and "bbox" in two:
        half = len(one["bbox"]) // 2
        pairs = list(zip(one["bbox"], two["bbox"], strict=True))
        merged["bbox"] = [*map(min, pairs[:half]), *map(max, pairs[half:])]
    return {**before, "columns": {before["primary_column"]: merged}}
