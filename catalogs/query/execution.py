"""Asking the catalogue of a published block, and showing the answer."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from catalogs.published.folders import Folder, each
from catalogs.published.items import COLUMNS, arrow_type
from catalogs.published.merged_items import Joined, joined_in, schema_of
from catalogs.published.runs import Run, runs_in
from catalogs.published.s3 import S3Folder, filesystem, folder_at, reached
from catalogs.published.snapshot import current
from catalogs.query.where import parse_since, refusal, select_where
from facade_core.core.errors import InputError

if TYPE_CHECKING:
    import duckdb
    import pandas as pd
    import pyarrow as pa

_SETTINGS: dict[str, str | bool | int | float | list[str]] = {
    "autoinstall_known_extensions": False,
    "autoload_known_extensions": False,
    "python_enable_replacements": False,
}


def query(
    out: Folder | str,
    *,
    where: str | None = None,
    bbox: Sequence[float] | None = None,
    since: str | None = None,
    note: Callable[[str], None] | None = None,
) -> pd.DataFrame:
    """Units published by the run in folder `out`, or by all runs in the folder of runs `out`, ordered as in their catalogues.

    out: may be s3://bucket/prefix. Columns as in catalogs.published.items.COLUMNS, then `run`: the run's folder relative to
    `out`, or its own name where `out` is the run. where: a boolean SQL expression over the columns. bbox: (west, south, east,
    north) in degrees; facades that touch it. since: see catalogs.query.where.parse_since; units updated then or later. note is
    told of each run that is left out, in one line. Integer columns are nullable integers, times are in UTC, geometry is WKB.
    Raises InputError in one line with the remedy.
    """
    import duckdb

    box, start = _checked_box(bbox), None if since is None else parse_since(since)
    with ExitStack() as holds, duckdb.connect(":memory:", config=_SETTINGS) as connection:
        files, found, schema = _published(out, note, holds)
        named = [*(one.path for one, _ in files), *(path for _, path, _ in found)]
        local = [path for path in named if isinstance(path, Path)]
        connection.execute("SET TimeZone = 'UTC'")
        # of the world the condition may see these files and no others, and only the columns that it names are read of all rows
        connection.execute(
            "SET allowed_paths = $1", [[form for p in local for form in (str(p.resolve()), _pattern(p))]]
        )
        parts = []
        joined = [(None, one.path, one.columns, stale) for one, stale in files]
        for number, (run, path, columns, stale) in enumerate([*joined, *((*one, []) for one in found)]):
            but = [f"run NOT IN ({', '.join(map(_text, stale))})"] if stale else []
            if isinstance(path, S3Folder):
                # DuckDB speaks S3 by an extension that it would download: Arrow reads, and skips what box and time rule out
                connection.register(f"rows_{number}", _dataset(path, columns, box, start))
                parts.append(_select(run, columns, schema, f"rows_{number}") + _conditions(columns, [], None, but))
            else:
                parts.append(_select(run, columns, schema, _read(path)) + _conditions(columns, box, start, but))
        connection.execute("SET enable_external_access = false")
        connection.execute("SET lock_configuration = true")
        connection.execute(f"CREATE TEMP VIEW items AS {' UNION ALL '.join(parts)}")
        if where is None:
            return _frame(_fetched(connection, "FROM items", schema))
        text = select_where(connection, "items", where, schema.names)
        try:
            return _frame(_fetched(connection, text, schema))
        except duckdb.Error as error:
            problem = str(error).splitlines()[0].partition(": ")[2].partition(" You might")[0]
            raise refusal(where, problem, "compare each column with a value of its type") from error


def _checked_box(bbox: Sequence[float] | None) -> list[float]:
    if bbox is None:
        return []
    box = [float(value) for value in bbox]
    if len(box) != 4 or not all(map(math.isfinite, box)) or box[0] > box[2] or box[1] > box[3]:
        raise InputError(
            f"--bbox {' '.join(f'{v:g}' for v in box)}: give WEST SOUTH EAST NORTH in degrees, west before east, "
            "such as 24.94 60.16 24.95 60.17"
        )
    return box


# A joined file, and the runs in it that have published since.
Files = list[tuple[Joined, list[str]]]


def _published(
    out: Folder | str, note: Callable[[str], None] | None, holds: ExitStack
) -> tuple[Files, list[tuple[Run, Folder, pa.Schema]], pa.Schema]:
    """The catalogues of the runs in `out`, as far as they are joined in files and else one by one, and all their columns; of
    several runs, those that cannot be read are left out. holds keeps them from being pruned."""
    import pyarrow as pa

    folder = folder_at(out)
    runs, left_out = runs_in(folder)
    united = pa.schema(pa.field(c.name, arrow_type(c)) for c in COLUMNS)
    files, rest = _joined(folder, runs) if len(runs) > 1 else ([], runs)
    for one, _ in files:
        united = pa.unify_schemas([united, one.columns], promote_options="permissive")
    readable = []
    for run in rest:
        try:
            path = holds.enter_context(current(run.folder).being_read()).items
            try:
                columns = schema_of(path)
                united = pa.unify_schemas([united, columns], promote_options="permissive")
            except (pa.ArrowTypeError, pa.ArrowInvalid, OSError) as error:
                raise InputError(_unreadable(run, path, error)) from error
            readable.append((run, path, columns))
        except InputError as error:
            if len(runs) == 1:
                raise
            left_out.append(f"{run.name} is left out: {error}")
    if not readable and not files:
        raise InputError(f"{out}: no run can be read; {left_out[-1]}")
    for line in left_out:
        if note:
            note(line)
    fields = [pa.field(field.name, field.type) for field in united if field.name != "run"]
    return files, readable, pa.schema([*fields[: len(COLUMNS)], pa.field("run", pa.string()), *fields[len(COLUMNS) :]])


def _joined(out: Folder, runs: Sequence[Run]) -> tuple[Files, list[Run]]:
    """The files in which runs are joined, and the runs that are not, or have published since."""
    files: Files = []
    found = joined_in(out)
    joined_at_all = {name for joined in found for name in joined.runs}
    asked = [run for run in runs if run.name in joined_at_all]
    now = dict(zip([run.name for run in asked], each(lambda run: _named(run.folder), asked, out), strict=True))
    fresh: set[str] = set()
    for joined in found:
        stands = {name for name, of in joined.runs.items() if now.get(name) == of} - fresh
        if stands:
            files.append((joined, sorted(joined.runs.keys() - stands)))
            fresh |= stands
    return files, [run for run in runs if run.name not in fresh]


def _named(folder: Folder) -> str | None:
    """The snapshot that `current` of a run names."""
    try:
        return (folder / "current").read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return None


def _unreadable(run: Run, path: Folder, error: Exception) -> str:
    import pyarrow as pa

    if isinstance(error, pa.ArrowTypeError):
        return f"{run.folder}: its columns differ in type from those of other runs; `streetloom run` publishes again"
    return f"{path} cannot be read as Parquet; `streetloom run` publishes again"


def _select(run: Run | None, columns: pa.Schema, schema: pa.Schema, source: str) -> str:
    """SQL for the rows of one run, or of those that a file names, with all columns."""
    return f"SELECT {', '.join(_column(name, run, columns) for name in schema.names)} FROM {source}"


def _conditions(columns: pa.Schema, box: Sequence[float], start: datetime | None, more: Sequence[str] = ()) -> str:
    """SQL for what lies within the box and was made since the start."""
    conditions = list(more)
    if start is not None:
        conditions.append(
            f"updated >= TIMESTAMPTZ {_text(start.isoformat())}" if "updated" in columns.names else "false"
        )
    if box:
        west, south, east, north = box
        conditions.append(f"xmax >= {west!r} AND ymax >= {south!r} AND xmin <= {east!r} AND ymin <= {north!r}")
    return f" WHERE {' AND '.join(conditions)}" if conditions else ""


def _dataset(path: S3Folder, columns: pa.Schema, box: Sequence[float], start: datetime | None) -> Any:
    """The same as an Arrow dataset over the file in a bucket, of which row groups without such rows are not fetched."""
    import pyarrow as pa
    from pyarrow import dataset

    with reached(path):
        rows = dataset.dataset(path.path, format="parquet", filesystem=filesystem())
    field = dataset.field
    if start is not None:
        updated = field("updated") >= pa.scalar(start, pa.timestamp("us", "UTC"))
        rows = rows.filter(updated if "updated" in columns.names else pa.scalar(False))
    if box:
        west, south, east, north = box
        within = (field("xmax") >= west) & (field("ymax") >= south) & (field("xmin") <= east) & (field("ymin") <= north)
        rows = rows.filter(within)
    return rows


def _column(name: str, run: Run | None, columns: pa.Schema) -> str:
    if name == "run" and run is not None:
        return f"{_text(run.name)} AS run"
    return _name(name) if name in columns.names else f"NULL AS {_name(name)}"


def _read(path: Path) -> str:
    return f"read_parquet({_text(_pattern(path))}, hive_partitioning = false)"


def _pattern(path: Path) -> str:
    """The pattern that matches a path alone: [, * and ? in one mean others to DuckDB."""
    return re.sub(r"([\[*?])", r"[\1]", str(path.resolve()))


def _name(column: str) -> str:
    return '"' + column.replace('"', '""') + '"'


def _text(value: str) -> str:
    return "'" + value.replace("'", "''") + "'"


def _fetched(connection: duckdb.DuckDBPyConnection, text: str, schema: pa.Schema) -> pa.Table:
    return connection.sql(text).to_arrow_table().select(schema.names).cast(schema)


def _frame(table: pa.Table) -> pd.DataFrame:
    import pandas as pd
    import pyarrow as pa

    nullable = {pa.int32(): pd.Int32Dtype(), pa.int64(): pd.Int64Dtype()}
    return table.to_pandas(types_mapper=nullable.get)
