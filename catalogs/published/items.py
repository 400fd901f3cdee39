"""Catalogue table items.parquet: one row per facade, and one per unit that was set aside."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from datetime import datetime
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catalogs.crs import LONLAT
from catalogs.features import natural_sort_key
from catalogs.published.columns import BBOX, COLUMNS, ITEM_KINDS, ROW_KEYS, STATUSES, ItemColumn, ItemRow, arrow_type
from facade_core.core.arrays import ObjectArray
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject

if TYPE_CHECKING:
    import pyarrow as pa
    from pyproj import CRS
    from shapely import LineString


_PYTHON_TYPES: dict[str, type] = {
    "string": str,
    "binary": bytes,
    "int32": Integral,
    "int64": Integral,
    "double": Real,
    "timestamp[us, UTC]": datetime,
}


def write_items(path: Path | str, rows: Sequence[ItemRow], crs: CRS | str) -> None:
    """Write the catalogue as GeoParquet, ordered by id, atomically.

    Parameters
    ----------
    rows : mappings with ROW_KEYS; `geometry` of a facade is a LineString in `crs`, `updated` is an aware datetime,
        None is unknown. A foot line with a non-finite coordinate becomes unknown.
    crs : any user input of pyproj.

    Raises
    ------
    InputError : names the facade and column of an unknown or missing key, a wrong type, or a duplicate id.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = Path(path)
    for row in rows:
        _check_row(row, path)
    rows = sorted(rows, key=lambda row: (ITEM_KINDS.index(str(row["kind"])), natural_sort_key(str(row["id"]))))
    for one, two in zip(rows, rows[1:], strict=False):
        if one["kind"] == two["kind"] == "facade" and one["id"] == two["id"]:
            raise InputError(f"{path.name}: facade {one['id']} has two rows; give each facade one")
    values = _column_values(rows, crs)
    arrays = [_arrow_array(column, values[column.name], rows, path) for column in COLUMNS]
    table = pa.Table.from_arrays(arrays, schema=_schema(values))
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        pq.write_table(table, temporary, compression="zstd")
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def _check_row(row: ItemRow, path: Path) -> None:
    facade = f"{path.name}: facade {row.get('id')}"
    if unknown := sorted(row.keys() - set(ROW_KEYS)):
        raise InputError(
            f"{facade}: no such column {unknown[0]}; add it to catalogs.published.columns.COLUMNS or leave it out"
        )
    if missing := [key for key in ROW_KEYS if key not in row]:
        raise InputError(f"{facade}: column {missing[0]} is missing; give None where it is unknown")
    if empty := [column.name for column in COLUMNS if column.required and row.get(column.name, 0) is None]:
        raise InputError(f"{facade}: column {empty[0]} is None; it needs a value in every row")
    if row["kind"] not in ITEM_KINDS:
        raise InputError(f"{facade}: kind is {row['kind']!r}; give one of {', '.join(ITEM_KINDS)}")
    if row["kind"] != "facade":
        if row["geometry"] is not None or row["status"] not in STATUSES[1:] or not row["reason"]:
            raise InputError(f"{facade}: a {row['kind']} has a row only when it failed or is refused, with a reason")
        return
    geometry = row["geometry"]
    if getattr(geometry, "geom_type", None) != "LineString" or getattr(geometry, "is_empty", True):
        raise InputError(f"{facade}: geometry is no LineString; give the facade's foot line")
    if row["status"] not in STATUSES:
        raise InputError(f"{facade}: status is {row['status']!r}; give one of {', '.join(STATUSES)}")
    if row["status"] == "failed" and not row["reason"]:
        raise InputError(f"{facade}: failed without a reason; say why")


def transform_foot_lines(foot_lines: Sequence[LineString | None], crs: CRS | str, target: CRS | str) -> ObjectArray:
    """Transform foot lines from one CRS to another, without heights.

    Parameters
    ----------
    foot_lines : (N,) lines in `crs`.

    Returns
    -------
    (N,) lines in `target`; None where a coordinate is not finite.
    """
    import shapely
    from pyproj import Transformer

    stated = np.empty(len(foot_lines), dtype=object)
    stated[:] = foot_lines
    flat = shapely.force_2d(stated)
    lines: ObjectArray = shapely.transform(
        flat, Transformer.from_crs(crs, target, always_xy=True).transform, interleaved=False
    )
    ends, line = shapely.get_coordinates(lines, return_index=True)
    lines[line[~np.isfinite(ends).all(axis=1)]] = None
    return lines


def _column_values(rows: Sequence[ItemRow], crs: CRS | str) -> dict[str, Sequence[object]]:
    import shapely

    feet = transform_foot_lines([row["geometry"] for row in rows], crs, LONLAT)
    values: dict[str, Sequence[object]] = {key: [row[key] for row in rows] for key in ROW_KEYS}
    values["geometry"] = [None if foot is None else shapely.to_wkb(foot) for foot in feet]
    return values | dict(zip(BBOX, shapely.bounds(feet).reshape(-1, 4).T.tolist(), strict=True))


def _arrow_array(column: ItemColumn, values: Sequence[object], rows: Sequence[ItemRow], path: Path) -> pa.Array:
    import pyarrow as pa

    values = [None if value is None or value != value else value for value in values]  # NaN is unknown too
    for row, value in zip(rows, values, strict=True):
        # Arrow would truncate 3.5 to 3, and treat a time without a zone as UTC
        if value is not None and (
            not isinstance(value, _PYTHON_TYPES[column.type]) or (isinstance(value, datetime) and not value.tzinfo)
        ):
            raise InputError(f"{path.name}: facade {row['id']}: {column.name} is {value!r}; give {column.type}")
    return pa.array(values, arrow_type(column))


def _schema(values: Mapping[str, Sequence[object]]) -> pa.Schema:
    """Return the Arrow schema with the GeoParquet 1.1 header (no crs means OGC:CRS84)."""
    import pyarrow as pa

    geometry: JsonObject = {"encoding": "WKB", "geometry_types": ["LineString"]}
    found = {name: [value for value in values[name] if isinstance(value, float) and value == value] for name in BBOX}
    if found["xmin"]:
        ends = zip(BBOX, (min, min, max, max), strict=True)
        geometry["bbox"] = [extreme(found[name]) for name, extreme in ends]
    geo = {"version": "1.1.0", "primary_column": "geometry", "columns": {"geometry": geometry}}
    fields = [
        pa.field(
            column.name,
            arrow_type(column),
            nullable=not column.required,
            metadata={"unit": column.unit, "meaning": column.meaning},
        )
        for column in COLUMNS
    ]
    return pa.schema(fields, metadata={"geo": json.dumps(geo)})
