"""Output formats of query results: table, JSON, GeoJSON and GeoParquet."""

from __future__ import annotations

import io
import json
import math
from collections import Counter
from collections.abc import Sequence
from datetime import datetime
from typing import TYPE_CHECKING

from catalogs.crs import LONLAT
from catalogs.printable_text import escape_invisible, escape_invisible_json
from catalogs.published.columns import BBOX
from catalogs.query.where import condition_columns
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject

if TYPE_CHECKING:
    import geopandas as gpd
    import pandas as pd

# Columns that fit a terminal; --format json shows all.
_TABLE_COLUMNS = (
    "id",
    "street",
    "height_m",
    "width_m",
    "floors",
    "windows",
    "doors",
    "balconies",
    "shops",
    "occluded",
    "quality",
    "status",
)

# Columns that a table shows only if needed.
_CONDITIONAL_COLUMNS = ("run", "kind", "reason", "geometry")


def format_items(items: pd.DataFrame, format: str = "table", where: str | None = None) -> str:
    """Format facades as an aligned table, a JSON array or a GeoJSON FeatureCollection.

    Parameters
    ----------
    format : table, json or geojson; GeoJSON is in lon/lat with 7 decimals, about 1 cm.
    where : condition of the query; the table includes its columns.

    Raises
    ------
    InputError : unknown format.
    """
    if format == "table":
        return _format_table(items, condition_columns(where or "", list(items.columns)))
    if format == "json":
        return escape_invisible_json(json.dumps(_records(items), indent=1, ensure_ascii=False, allow_nan=False))
    if format == "geojson":
        return escape_invisible_json(json.dumps(_feature_collection(items), ensure_ascii=False, allow_nan=False))
    raise InputError(f"--format {format}: not text, or not known; choose table, json, geojson")


def to_geodataframe(items: pd.DataFrame) -> gpd.GeoDataFrame:
    """Return the facades with their foot lines as geometry, in lon/lat."""
    import geopandas as gpd
    import shapely

    feet = shapely.from_wkb(items["geometry"].to_numpy(dtype=object))
    return gpd.GeoDataFrame(items.drop(columns="geometry"), geometry=feet, crs=LONLAT)


def to_parquet_bytes(items: pd.DataFrame) -> bytes:
    """Return the facades as a GeoParquet file."""
    buffer = io.BytesIO()
    to_geodataframe(items).to_parquet(buffer, compression="zstd")
    return buffer.getvalue()


def _records(items: pd.DataFrame) -> list[JsonObject]:
    """Return rows without geometry; values that JSON lacks (missing, infinite) are None."""
    records = items.drop(columns="geometry").astype(object).to_dict("records")
    return [{str(name): _json_value(value) for name, value in record.items()} for record in records]


def _json_value(value: str | float | datetime | None) -> str | float | None:
    import pandas as pd

    if pd.isna(value) or (isinstance(value, float) and math.isinf(value)):
        return None
    return value.isoformat().replace("+00:00", "Z") if isinstance(value, datetime) else value


def _feature_collection(items: pd.DataFrame) -> JsonObject:
    import shapely

    feet = shapely.transform(shapely.from_wkb(items["geometry"].to_numpy(dtype=object)), lambda ends: ends.round(7))
    features = [
        {
            "type": "Feature",
            "id": row["id"],
            **({} if foot is None else {"bbox": [round(row[side], 7) for side in BBOX]}),
            "geometry": None if foot is None else shapely.geometry.mapping(foot),
            "properties": {key: value for key, value in row.items() if key not in ("id", *BBOX)},
        }
        for row, foot in zip(_records(items), feet, strict=True)
    ]
    return {"type": "FeatureCollection", "features": features}


def _format_table(items: pd.DataFrame, asked: Sequence[str]) -> str:
    from pandas.api.types import is_numeric_dtype

    if items.empty:
        return "no facade matches"
    head = _table_columns(items, asked)
    rows = [[_format_cell(name, row[name]) for name in head] for row in _records(items)]
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    text = {name for name in head if not is_numeric_dtype(items[name])}

    def format_line(cells: Sequence[str]) -> str:
        parts = zip(head, cells, widths, strict=True)
        return "  ".join(c.ljust(w) if name in text else c.rjust(w) for name, c, w in parts).rstrip()

    kinds = Counter(items["kind"]) if "kind" in items else {"facade": len(rows)}
    count = ", ".join(f"{number} {kind}{'s' * (number != 1)}" for kind, number in kinds.items())
    return "\n".join(
        [format_line(head), format_line(["-" * width for width in widths]), *map(format_line, rows), count]
    )


def _table_columns(items: pd.DataFrame, asked: Sequence[str]) -> list[str]:
    """Return the columns of a table: the usual ones, those that are asked for, and those that say something here."""
    head = [name for name in _TABLE_COLUMNS if name in items]
    head[-1:-1] = [name for name in asked if name not in (*_TABLE_COLUMNS, *_CONDITIONAL_COLUMNS)]
    if "run" in items and items["run"].nunique() > 1:
        head.insert(0, "run")
    if "kind" in items and (items["kind"] != "facade").any():
        head.insert(head.index("id") + 1, "kind")
    if "reason" in items and items["reason"].notna().any():
        head.append("reason")
    return head


def _format_cell(name: str, value: object) -> str:
    if value is None:
        return "-"
    return f"{value:.2f}" if isinstance(value, float) else escape_invisible(str(value))
