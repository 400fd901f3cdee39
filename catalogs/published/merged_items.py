"""Merged catalogues of many runs, so that a query of ten thousand runs opens a hundred files.

OUT/items/N.parquet holds the rows of up to RUNS_PER_FILE runs with their names in `run`, and states in its metadata
which snapshot of each run they are. The files are caches: rows of a run that has published since are read from the
run.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from catalogs.published import object_store
from catalogs.published.file_list import has_other_content
from catalogs.published.folders import F, Folder, map_concurrently, remove_path, write_atomically
from catalogs.published.runs import PublishedRun
from catalogs.published.s3 import S3Path
from catalogs.published.snapshot import snapshot_folder

if TYPE_CHECKING:
    import pyarrow as pa

ITEMS_FOLDER = "items"
RUNS_METADATA_KEY = b"streetloom:runs"
RUNS_PER_FILE = 128


@dataclass(frozen=True)
class MergedItemsFile:
    """File with the rows of several runs.

    Attributes
    ----------
    path : the file.
    columns : its Arrow schema.
    runs : name of the run -> snapshot whose rows it holds.
    """

    path: Folder
    columns: pa.Schema
    runs: dict[str, str]


def read_merged_items_headers(out: Folder) -> list[MergedItemsFile]:
    """Read the headers of the merged files of a folder of runs; unreadable files are skipped."""
    return [one for one in map_concurrently(_read_merged_file, _merged_files(out), out) if one is not None]


def _read_merged_file(path: Folder) -> MergedItemsFile | None:
    import pyarrow as pa

    try:
        columns = read_parquet_schema(path)
        runs = json.loads((columns.metadata or {})[RUNS_METADATA_KEY])
        return MergedItemsFile(
            path, columns.remove_metadata(), {str(run): str(snapshot) for run, snapshot in runs.items()}
        )
    except (OSError, ValueError, KeyError, AttributeError, pa.ArrowException):
        return None


def read_parquet_schema(path: Folder) -> pa.Schema:
    """Read the schema of a Parquet file."""
    import pyarrow.parquet as pq

    if isinstance(path, S3Path):
        return pq.read_schema(path.path, filesystem=object_store.arrow_filesystem())
    return pq.read_schema(path)


def _merged_files(out: Folder) -> list[Folder]:
    folder = out / ITEMS_FOLDER
    found: Iterable[Folder] = folder.iterdir() if folder.is_dir() else ()
    # names of partial files begin with a dot
    return sorted((one for one in found if one.name.endswith(".parquet") and one.name[0] != "."), key=str)


def merge_run_items(out: Folder, runs: Sequence[tuple[PublishedRun[F], str]]) -> None:
    """Merge the catalogues of runs, each given with its current snapshot.

    Only files with a changed run are rewritten. A run whose catalogue is unreadable, or does not fit the others, is
    left out.
    """
    if isinstance(out, Path):
        (out / ITEMS_FOLDER).mkdir(exist_ok=True)
    before = {member.path.name: member.runs for member in read_merged_items_headers(out)}
    assigned = {run: file for file, members in before.items() for run in members}
    by_file: dict[str, list[tuple[PublishedRun[F], str]]] = {file: [] for file in before}
    for member in runs:
        if member[0].name in assigned:
            by_file[assigned[member[0].name]].append(member)
    number = 0
    for member in runs:
        if member[0].name not in assigned:
            while len(by_file.setdefault(f"{number:05}.parquet", [])) >= RUNS_PER_FILE:
                number += 1
            by_file[f"{number:05}.parquet"].append(member)
    for file, members in by_file.items():
        if members and before.get(file) != {run.name: snapshot for run, snapshot in members}:
            _write_rows(out / ITEMS_FOLDER / file, members)
    for path in _merged_files(out):
        if not by_file.get(path.name):
            remove_path(path)


def _write_rows(path: Folder, runs: Sequence[tuple[PublishedRun[F], str]]) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    tables, schema, snapshots = [], pa.schema([]), {}
    for (run, snapshot), table in zip(runs, map_concurrently(_read_rows, runs, path), strict=True):
        if table is None:
            continue
        try:
            schema = pa.unify_schemas([schema, table.schema.remove_metadata()], promote_options="permissive")
        except pa.ArrowException:
            continue
        names = pa.array([run.name] * len(table), pa.string())
        tables.append(table.append_column("run", names).replace_schema_metadata(None))
        snapshots[run.name] = snapshot
    if not tables:
        remove_path(path)
        return
    rows = pa.concat_tables(tables, promote_options="permissive").replace_schema_metadata(
        {RUNS_METADATA_KEY: json.dumps(snapshots)}
    )
    written = pa.BufferOutputStream()
    pq.write_table(rows, written, compression="zstd")
    write_atomically(path, written.getvalue().to_pybytes())


def _read_rows(one: tuple[PublishedRun[F], str]) -> pa.Table | None:
    """Read the rows of a run's catalogue; None if it cannot be read."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    run, snapshot = one
    items = snapshot_folder(run.folder, snapshot).items
    try:
        if has_other_content(items):
            return None
        table = pq.read_table(pa.BufferReader(items.read_bytes()))
        return table.select([name for name in table.column_names if name != "run"])
    except (OSError, pa.ArrowException):
        return None
