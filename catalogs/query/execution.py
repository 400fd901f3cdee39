"""Execution of queries on the catalogues of published runs, with DuckDB."""

from __future__ import annotations

import glob
import math
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from catalogs.buildings.axis_mistakes import SWAPPED_AXES_NOTE, format_numbers, reject_metres
from catalogs.printable_text import normal_form
from catalogs.published import object_store
from catalogs.published.columns import COLUMNS, arrow_type
from catalogs.published.folders import Folder, map_concurrently
from catalogs.published.merged_items import MergedItemsFile, read_merged_items_headers, read_parquet_schema
from catalogs.published.runs import PublishedRun, find_runs
from catalogs.published.s3 import S3Path, folder_at
from catalogs.published.snapshot import current_snapshot
from catalogs.query.where import build_checked_select, condition_error, parse_since
from facade_core.core.errors import InputError

if TYPE_CHECKING:
    import duckdb
    import pandas as pd
    import pyarrow as pa
    from pyarrow.dataset import Dataset

_DUCKDB_SETTINGS: dict[str, str | bool | int | float | list[str]] = {
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
    on_left_out: Callable[[str], None] | None = None,
) -> pd.DataFrame:
    """Query the units published by a run, or by all runs in a folder, ordered as in their catalogues.

    Parameters
    ----------
    out : folder of a run or of runs; may be s3://bucket/prefix.
    where : boolean SQL expression over the columns.
    bbox : (west, south, east, north) in degrees; selects facades that touch it.
    since : selects units updated then or later; see catalogs.query.where.parse_since.
    on_left_out : called with one line for each run that is left out.

    Returns
    -------
    Columns of catalogs.published.columns.COLUMNS, then `run`: the run's folder relative to `out`, or its own name if
    `out` is the run. Integer columns are nullable, times are in UTC, geometry is WKB.

    Raises
    ------
    InputError : one line with the remedy.
    """
    where = where if where is None else normal_form(where)
    box, start = _parse_box(bbox), None if since is None else parse_since(since)
    found = _select_rows(out, where, box, start, on_left_out)
    if found.empty and box:
        south, west, north, east = box
        swapped = [west, south, east, north]
        if not _select_rows(out, where, swapped, start, None).empty:
            raise InputError(f"--bbox {format_numbers(box)}: {SWAPPED_AXES_NOTE}: write {format_numbers(swapped)}")
    return found


def _select_rows(
    out: Folder | str,
    where: str | None,
    box: Sequence[float],
    start: datetime | None,
    on_left_out: Callable[[str], None] | None,
) -> pd.DataFrame:
    import duckdb

    with ExitStack() as holds, duckdb.connect(":memory:", config=_DUCKDB_SETTINGS) as connection:
        files, found, schema = _find_catalogues(out, on_left_out, holds)
        named = [*(one.path for one, _ in files), *(path for _, path, _ in found)]
        local = [path for path in named if isinstance(path, Path)]
        connection.execute("SET TimeZone = 'UTC'")
        # the condition has access to these files only; DuckDB reads only the columns that it names
        places = [str(path.resolve()) for path in local]
        connection.execute("SET allowed_paths = $1", [[*places, *map(glob.escape, places)]])
        parts = []
        joined = [(None, one.path, one.columns, stale) for one, stale in files]
        for number, (run, path, columns, stale) in enumerate([*joined, *((*one, []) for one in found)]):
            but = [f"run NOT IN ({', '.join(map(_quote_text, stale))})"] if stale else []
            if isinstance(path, S3Path):
                # DuckDB would download an extension for S3, so Arrow reads, with filters on box and time
                connection.register(f"rows_{number}", _filtered_dataset(path, columns, box, start))
                parts.append(_select_sql(run, columns, schema, f"rows_{number}") + _where_sql(columns, [], None, but))
            else:
                parts.append(
                    _select_sql(run, columns, schema, _parquet_sql(path)) + _where_sql(columns, box, start, but)
                )
        connection.execute("SET enable_external_access = false")
        connection.execute("SET lock_configuration = true")
        connection.execute(f"CREATE TEMP VIEW items AS {' UNION ALL '.join(parts)}")
        text = "FROM items" if where is None else build_checked_select(connection, "items", where, schema.names)
        try:
            return _to_pandas(_run_sql(connection, text, schema))
        except duckdb.Error as error:
            if where is None:
                raise InputError(f"{named[0]} cannot be read as Parquet; `streetloom run` publishes again") from error
            problem = str(error).splitlines()[0].partition(": ")[2].partition(" You might")[0]
            raise condition_error(where, problem, "compare each column with a value of its type") from error


def _parse_box(bbox: Sequence[float] | None) -> list[float]:
    if bbox is None:
        return []
    box = [float(value) for value in bbox]
    if len(box) != 4 or not all(map(math.isfinite, box)) or box[0] > box[2] or box[1] > box[3]:
        raise InputError(
            f"--bbox {format_numbers(box)}: give WEST SOUTH EAST NORTH in degrees, west before east, "
            "such as 24.94 60.16 24.95 60.17"
        )
    reject_metres("--bbox", box)
    return box


# Merged files, each with the runs in it that have published since.
MergedFiles = list[tuple[MergedItemsFile, list[str]]]


def _find_catalogues(
    out: Folder | str, note: Callable[[str], None] | None, holds: ExitStack
) -> tuple[MergedFiles, list[tuple[PublishedRun[Folder], Folder, pa.Schema]], pa.Schema]:
    """Return the merged files, the catalogues of other runs, and the union of their columns.

    Of several runs, unreadable ones are left out. `holds` keeps their folders from being pruned.
    """
    import pyarrow as pa

    folder = folder_at(out)
    runs, left_out = find_runs(folder)
    united = pa.schema(pa.field(c.name, arrow_type(c)) for c in COLUMNS)
    files, rest = _match_merged_files(folder, runs) if len(runs) > 1 else ([], runs)
    for one, _ in files:
        united = pa.unify_schemas([united, one.columns], promote_options="permissive")
    readable = []
    for run in rest:
        try:
            path = holds.enter_context(current_snapshot(run.folder).hold_for_reading()).items
            try:
                columns = read_parquet_schema(path)
                united = pa.unify_schemas([united, columns], promote_options="permissive")
            except (pa.ArrowTypeError, pa.ArrowInvalid, OSError) as error:
                raise InputError(_unreadable_message(run, path, error)) from error
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


def _match_merged_files(
    out: Folder, runs: Sequence[PublishedRun[Folder]]
) -> tuple[MergedFiles, list[PublishedRun[Folder]]]:
    """Return the merged files with their outdated runs, and the runs that must be read themselves."""
    files: MergedFiles = []
    found = read_merged_items_headers(out)
    joined_at_all = set().union(*(joined.runs for joined in found))
    asked = [run for run in runs if run.name in joined_at_all]
    now = dict(map_concurrently(lambda run: (run.name, _current_id(run.folder)), asked, out))
    covered: set[str] = set()
    for joined in found:
        valid = {name for name, snapshot in joined.runs.items() if now.get(name) == snapshot} - covered
        if valid:
            files.append((joined, sorted(joined.runs.keys() - valid)))
            covered |= valid
    return files, [run for run in runs if run.name not in covered]


def _current_id(folder: Folder) -> str | None:
    """Return the id of the snapshot that `current` of a run names."""
    try:
        return (folder / "current").read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return None


def _unreadable_message(run: PublishedRun[Folder], path: Folder, error: Exception) -> str:
    import pyarrow as pa

    if isinstance(error, pa.ArrowTypeError):
        return f"{run.folder}: its columns differ in type from those of other runs; `streetloom run` publishes again"
    return f"{path} cannot be read as Parquet; `streetloom run` publishes again"


def _select_sql(run: PublishedRun[Folder] | None, columns: pa.Schema, schema: pa.Schema, source: str) -> str:
    """Return SQL for the rows of one run or merged file, with all columns."""
    return f"SELECT {', '.join(_column_sql(name, run, columns) for name in schema.names)} FROM {source}"


def _where_sql(columns: pa.Schema, box: Sequence[float], start: datetime | None, more: Sequence[str] = ()) -> str:
    """Return SQL for rows within the box and updated since the start."""
    conditions = list(more)
    if start is not None:
        conditions.append(
            f"updated >= TIMESTAMPTZ {_quote_text(start.isoformat())}" if "updated" in columns.names else "false"
        )
    if box:
        west, south, east, north = box
        conditions.append(f"xmax >= {west!r} AND ymax >= {south!r} AND xmin <= {east!r} AND ymin <= {north!r}")
    return f" WHERE {' AND '.join(conditions)}" if conditions else ""


def _filtered_dataset(path: S3Path, columns: pa.Schema, box: Sequence[float], start: datetime | None) -> Dataset:
    """Return the file in a bucket as an Arrow dataset with filters on box and time.

    Row groups without matching rows are not fetched.
    """
    import pyarrow as pa
    from pyarrow import dataset

    with object_store.translate_errors(path.path):
        rows = dataset.dataset(path.path, format="parquet", filesystem=object_store.arrow_filesystem())
    field = dataset.field
    if start is not None:
        updated = field("updated") >= pa.scalar(start, pa.timestamp("us", "UTC"))
        rows = rows.filter(updated if "updated" in columns.names else pa.scalar(False))
    if box:
        west, south, east, north = box
        within = (field("xmax") >= west) & (field("ymax") >= south) & (field("xmin") <= east) & (field("ymin") <= north)
        rows = rows.filter(within)
    return rows


def _column_sql(name: str, run: PublishedRun[Folder] | None, columns: pa.Schema) -> str:
    if name == "run" and run is not None:
        return f"{_quote_text(run.name)} AS run"
    return _quote_name(name) if name in columns.names else f"NULL AS {_quote_name(name)}"


def _parquet_sql(path: Path) -> str:
    return f"read_parquet({_quote_text(glob.escape(str(path.resolve())))}, hive_partitioning = false)"


def _quote_name(column: str) -> str:
    return '"' + column.replace('"', '""') + '"'


def _quote_text(value: str) -> str:
    return "'" + value.replace("'", "''") + "'"


def _run_sql(connection: duckdb.DuckDBPyConnection, text: str, schema: pa.Schema) -> pa.Table:
    return connection.sql(text).to_arrow_table().select(schema.names).cast(schema)


def _to_pandas(table: pa.Table) -> pd.DataFrame:
    import pandas as pd
    import pyarrow as pa

    nullable = {pa.int32(): pd.Int32Dtype(), pa.int64(): pd.Int64Dtype()}
    items: pd.DataFrame = table.to_pandas(types_mapper=nullable.get)
    return items
