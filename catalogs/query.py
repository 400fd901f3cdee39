"""Asking the catalogue of a published block, and showing the answer."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from catalogs.items import BBOX
from catalogs.where import refusal, select_where
from facade_core.errors import InputError

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

FORMATS = ("table", "json", "geojson")
# What fits a terminal; --format json shows everything.
_TABLE = (
    "id",
    "street",
    "height_m",
    "width_m",
    "floors",
    "windows",
    "doors",
    "balconies",
    "shops",
    "window_to_wall",
    "occluded",
    "status",
)
_SETTINGS: dict[str, str | bool | int | float | list[str]] = {
    "autoinstall_known_extensions": False,
    "autoload_known_extensions": False,
    "python_enable_replacements": False,
}


def query(out: Path | str, *, where: str | None = None, bbox: Sequence[float] | None = None) -> pd.DataFrame:
    """Facades of the published block in folder `out`, ordered as in the catalogue; columns as in catalogs.items.COLUMNS.

    where: a boolean SQL expression over the columns. bbox: (west, south, east, north) in degrees; facades that touch it.
    Integer columns are nullable integers, geometry is WKB. Raises InputError in one line with the remedy.
    """
    import duckdb

    box = _checked_box(bbox)
    published = _read(items_path(out))
    with duckdb.connect(":memory:", config=_SETTINGS) as connection:
        connection.register("published", published)
        select = "CREATE TEMP TABLE items AS SELECT * FROM published"
        if box:
            select += " WHERE xmax >= ? AND ymax >= ? AND xmin <= ? AND ymin <= ?"
        connection.execute(select, box)
        connection.unregister("published")
        connection.execute("SET enable_external_access = false")
        connection.execute("SET lock_configuration = true")
        if where is None:
            return _frame(connection.sql("FROM items").to_arrow_table())
        text = select_where(connection, "items", where, published.column_names)
        try:
            return _frame(connection.sql(text).to_arrow_table())
        except duckdb.Error as error:
            problem = str(error).splitlines()[0].partition(": ")[2].partition(" You might")[0]
            raise refusal(where, problem, "compare each column with a value of its type") from error


def items_path(out: Path | str) -> Path:
    """The catalogue that `out`/current points at; InputError where nothing is published."""
    out = Path(out)
    if not out.is_dir():
        raise InputError(f"{out}: no such folder; `streetloom run BLOCK.yaml --out {out}` makes it")
    pointer = out / "current"
    if not pointer.is_file():
        raise InputError(
            f"{out}: nothing is published there; `streetloom run BLOCK.yaml --out {out}` finishes and publishes"
        )
    snapshot = pointer.read_text(encoding="utf-8", errors="replace").strip()
    if not re.fullmatch(r"[A-Za-z0-9_-]+", snapshot):
        raise InputError(
            f"{pointer} does not hold a snapshot id; `streetloom run BLOCK.yaml --out {out}` publishes again"
        )
    path = out / "published" / snapshot / "items.parquet"
    if not path.is_file():
        raise InputError(f"{path} is missing; `streetloom run BLOCK.yaml --out {out}` publishes again")
    return path


def format_items(items: pd.DataFrame, format: str = "table") -> str:
    """The facades as aligned text, a JSON array, or a GeoJSON FeatureCollection (lon/lat, 7 decimals, about 1 cm)."""
    if format == "table":
        return _table(items)
    if format == "json":
        return json.dumps(_records(items), indent=1, ensure_ascii=False, allow_nan=False)
    if format == "geojson":
        return json.dumps(_collection(items), ensure_ascii=False, allow_nan=False)
    raise InputError(f"--format {format}: not known; choose {', '.join(FORMATS)}")


def _checked_box(bbox: Sequence[float] | None) -> list[float]:
    if bbox is None:
        return []
    box = [float(value) for value in bbox]
    if len(box) != 4 or not all(map(math.isfinite, box)) or box[0] > box[2] or box[1] > box[3]:
        raise InputError(
            f"--bbox {' '.join(f'{v:g}' for v in box)}: give WEST SOUTH EAST NORTH in degrees, west before east"
        )
    return box


def _read(path: Path) -> pa.Table:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return pq.read_table(path)
    except (pa.ArrowException, OSError) as error:
        raise InputError(f"{path} cannot be read as Parquet; `streetloom run` publishes again") from error


def _frame(found: pa.Table) -> pd.DataFrame:
    import pandas as pd
    import pyarrow as pa

    nullable = {pa.int32(): pd.Int32Dtype(), pa.int64(): pd.Int64Dtype()}
    return found.to_pandas(types_mapper=nullable.get)


def _records(items: pd.DataFrame) -> list[dict[str, Any]]:
    """Rows without their geometry; what JSON cannot say (missing, infinite) is None."""
    records = items.drop(columns="geometry").astype(object).to_dict("records")
    return [{str(name): _plain(value) for name, value in record.items()} for record in records]


def _plain(value: Any) -> Any:
    import pandas as pd

    return None if pd.isna(value) or (isinstance(value, float) and math.isinf(value)) else value


def _collection(items: pd.DataFrame) -> dict[str, Any]:
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


def _table(items: pd.DataFrame) -> str:
    if items.empty:
        return "no facade matches"
    head = [name for name in _TABLE if name in items]
    if "kind" in items and (items["kind"] != "facade").any():
        head.insert(1, "kind")
    if "reason" in items and items["reason"].notna().any():
        head.append("reason")
    rows = [[_cell(name, row[name]) for name in head] for row in _records(items)]
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    text = {"id", "kind", "street", "status", "reason"}

    def line(cells: Sequence[str]) -> str:
        parts = zip(head, cells, widths, strict=True)
        return "  ".join(c.ljust(w) if name in text else c.rjust(w) for name, c, w in parts).rstrip()

    kinds = Counter(items["kind"]) if "kind" in items else {"facade": len(rows)}
    count = ", ".join(f"{n} {kind}{'s' if n != 1 else ''}" for kind, n in kinds.items())
    return "\n".join([line(head), line(["-" * width for width in widths]), *map(line, rows), count])


def _cell(name: str, value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.2f}" if isinstance(value, float) else str(value)
