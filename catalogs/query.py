"""Asking the catalogue of a published block, and showing the answer."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from catalogs.features import natural_order
from catalogs.items import BBOX, COLUMNS, arrow_type
from catalogs.where import parse_since, refusal, select_where
from facade_core.errors import InputError

if TYPE_CHECKING:
    import duckdb
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


@dataclass(frozen=True, slots=True)
class Run:
    """A run's folder and its name: relative to the folder of runs that was asked for, else the folder's own."""

    folder: Path
    name: str


def query(
    out: Path | str,
    *,
    where: str | None = None,
    bbox: Sequence[float] | None = None,
    since: str | None = None,
    note: Callable[[str], None] | None = None,
) -> pd.DataFrame:
    """Units published by the run in folder `out`, or by all runs in the folder of runs `out`, ordered as in their catalogues.

    Columns as in catalogs.items.COLUMNS, then `run`: the run's folder relative to `out`, or its own name where `out` is the
    run. where: a boolean SQL expression over the columns. bbox: (west, south, east, north) in degrees; facades that touch it.
    since: see catalogs.where.parse_since; units updated then or later. note is told of each run that is left out, in one line.
    Integer columns are nullable integers, times are in UTC, geometry is WKB. Raises InputError in one line with the remedy.
    """
    import duckdb

    box, start = _checked_box(bbox), None if since is None else parse_since(since)
    paths, schema = _published(Path(out), note)
    with duckdb.connect(":memory:", config=_SETTINGS) as connection:
        connection.execute("SET TimeZone = 'UTC'")
        # of the world the condition may see these files and no others, and only the columns that it names are read of all rows
        connection.execute(
            "SET allowed_paths = $1", [[form for _, path, _ in paths for form in (str(path.resolve()), _pattern(path))]]
        )
        connection.execute("SET enable_external_access = false")
        connection.execute("SET lock_configuration = true")
        parts = [_select(run, path, held, schema, box, start) for run, path, held in paths]
        connection.execute(f"CREATE TEMP VIEW items AS {' UNION ALL '.join(parts)}")
        if where is None:
            return _frame(_fetched(connection, "FROM items", schema))
        text = select_where(connection, "items", where, schema.names)
        try:
            return _frame(_fetched(connection, text, schema))
        except duckdb.Error as error:
            problem = str(error).splitlines()[0].partition(": ")[2].partition(" You might")[0]
            raise refusal(where, problem, "compare each column with a value of its type") from error


def runs_in(folder: Path) -> tuple[list[Run], list[str]]:
    """The runs that have published, and a line about each that has not: `folder` itself, else those at most two levels down.

    A run is known by its `current`, or by its store before it has published, and is not searched for others. Raises
    InputError where `folder` holds no run that has published.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; `streetloom run BLOCK.yaml --out {folder}` makes it")
    if (folder / "current").is_file():
        return [Run(folder, folder.resolve().name)], []
    runs, left_out = [], []
    waiting = [folder]
    while waiting:
        parent = waiting.pop()
        try:
            for child in sorted(path for path in parent.iterdir() if path.is_dir() and not path.name.startswith(".")):
                name = child.relative_to(folder).as_posix()
                if (child / "current").is_file():
                    runs.append(Run(child, name))
                elif (child / "store").is_dir():
                    left_out.append(f"{name} is left out: nothing is published there yet")
                elif parent == folder:
                    waiting.append(child)
        except OSError as error:
            left_out.append(f"{parent} is left out: {error.strerror}")
    if not runs:
        raise InputError(
            f"{folder}: nothing is published there; `streetloom run BLOCK.yaml --out {folder}` finishes and publishes"
        )
    runs.sort(key=lambda run: natural_order(run.name))
    return runs, sorted(left_out, key=natural_order)


def items_path(out: Path | str) -> Path:
    """The catalogue that `current` of the run in folder `out` points at; InputError where it points at none."""
    pointer = Path(out) / "current"
    try:
        snapshot = pointer.read_text(encoding="utf-8", errors="replace").strip()
    except OSError as error:
        raise InputError(f"{pointer} cannot be read: {error.strerror}; `streetloom run` writes it") from error
    if not re.fullmatch(r"[A-Za-z0-9_-]+", snapshot):
        raise InputError(
            f"{pointer} does not hold a snapshot id; `streetloom run BLOCK.yaml --out {out}` publishes again"
        )
    path = pointer.parent / "published" / snapshot / "items.parquet"
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


def _published(out: Path, note: Callable[[str], None] | None) -> tuple[list[tuple[Run, Path, pa.Schema]], pa.Schema]:
    """The catalogues of the runs in `out`, and all their columns; of several runs, those that cannot be read are left out."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    runs, left_out = runs_in(out)
    united = pa.schema(pa.field(c.name, arrow_type(c)) for c in COLUMNS)
    found = []
    for run in runs:
        try:
            path = items_path(run.folder)
            try:
                held = pq.read_schema(path)
                united = pa.unify_schemas([united, held], promote_options="permissive")
            except (pa.ArrowTypeError, pa.ArrowInvalid, OSError) as error:
                raise InputError(_unreadable(run, path, error)) from error
            found.append((run, path, held))
        except InputError as error:
            if len(runs) == 1:
                raise
            left_out.append(f"{run.name} is left out: {error}")
    if not found:
        raise InputError(f"{out}: no run can be read; {left_out[-1]}")
    for line in left_out:
        if note:
            note(line)
    fields = [pa.field(field.name, field.type) for field in united if field.name != "run"]
    return found, pa.schema([*fields[: len(COLUMNS)], pa.field("run", pa.string()), *fields[len(COLUMNS) :]])


def _unreadable(run: Run, path: Path, error: Exception) -> str:
    import pyarrow as pa

    if isinstance(error, pa.ArrowTypeError):
        return f"{run.folder}: its columns differ in type from those of other runs; `streetloom run` publishes again"
    return f"{path} cannot be read as Parquet; `streetloom run` publishes again"


def _select(
    run: Run, path: Path, held: pa.Schema, schema: pa.Schema, box: Sequence[float], start: datetime | None
) -> str:
    """SQL for the rows of one run within the box and since the start, with all columns."""
    columns = [_column(name, run, held) for name in schema.names]
    conditions = []
    if start is not None:
        conditions.append(f"updated >= TIMESTAMPTZ {_text(start.isoformat())}" if "updated" in held.names else "false")
    if box:
        west, south, east, north = box
        conditions.append(f"xmax >= {west!r} AND ymax >= {south!r} AND xmin <= {east!r} AND ymin <= {north!r}")
    where = f" WHERE {' AND '.join(conditions)}" if conditions else ""
    source = f"read_parquet({_text(_pattern(path))}, hive_partitioning = false)"
    return f"SELECT {', '.join(columns)} FROM {source}{where}"


def _column(name: str, run: Run, held: pa.Schema) -> str:
    if name == "run":
        return f"{_text(run.name)} AS run"
    return _name(name) if name in held.names else f"NULL AS {_name(name)}"


def _pattern(path: Path) -> str:
    """The pattern that matches a path alone: [, * and ? in one mean others to DuckDB."""
    return re.sub(r"([\[*?])", r"[\1]", str(path.resolve()))


def _name(column: str) -> str:
    return '"' + column.replace('"', '""') + '"'


def _text(value: str) -> str:
    return "'" + value.replace("'", "''") + "'"


def _fetched(connection: duckdb.DuckDBPyConnection, text: str, schema: pa.Schema) -> pa.Table:
    return connection.sql(text).to_arrow_table().select(schema.names).cast(schema)


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

    if pd.isna(value) or (isinstance(value, float) and math.isinf(value)):
        return None
    return value.isoformat().replace("+00:00", "Z") if isinstance(value, datetime) else value


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
    if "run" in items and items["run"].nunique() > 1:
        head.insert(0, "run")
    if "kind" in items and (items["kind"] != "facade").any():
        head.insert(head.index("id") + 1, "kind")
    if "reason" in items and items["reason"].notna().any():
        head.append("reason")
    rows = [[_cell(name, row[name]) for name in head] for row in _records(items)]
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    text = {"run", "id", "kind", "street", "status", "reason"}

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
