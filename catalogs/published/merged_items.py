"""The catalogues of many runs, joined: a query of ten thousand runs opens a hundred files.

OUT/items/N.parquet holds the rows of up to PER_FILE runs with their names in `run`, and says of itself of which snapshot of
which run they are: whatever happens, a file is true of what it says. It is a copy that is kept up: what a run has published
since is read of the run.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from catalogs.published.folders import Folder, each, put, remove
from catalogs.published.runs import Run
from catalogs.published.s3 import S3Folder, filesystem

if TYPE_CHECKING:
    import pyarrow as pa

FOLDER, SAID = "items", b"streetloom:runs"
PER_FILE = 128


@dataclass(frozen=True)
class Joined:
    """A file of several runs' rows: its columns, and the snapshot of each run, by name, whose rows it holds."""

    path: Folder
    columns: pa.Schema
    runs: dict[str, str]


def joined_in(out: Folder) -> list[Joined]:
    """The joined files of a folder of runs; one that cannot be read is none."""
    return [one for one in each(_joined, _files(out), out) if one is not None]


def _joined(path: Folder) -> Joined | None:
    import pyarrow as pa

    try:
        columns = schema_of(path)
        runs = json.loads((columns.metadata or {})[SAID])
        return Joined(path, columns.remove_metadata(), {str(run): str(of) for run, of in runs.items()})
    except (OSError, ValueError, KeyError, AttributeError, pa.ArrowException):
        return None


def schema_of(path: Folder) -> pa.Schema:
    """The columns of a Parquet file."""
    import pyarrow.parquet as pq

    return pq.read_schema(path.path, filesystem=filesystem()) if isinstance(path, S3Folder) else pq.read_schema(path)


def _files(out: Folder) -> list[Folder]:
    folder = out / FOLDER
    found: Iterable[Folder] = folder.iterdir() if folder.is_dir() else ()
    # a name that begins with a dot is of a file that is being written
    return sorted((one for one in found if one.name.endswith(".parquet") and one.name[0] != "."), key=str)


def join_runs(out: Folder, runs: Sequence[tuple[Run, str]]) -> None:
    """Join the catalogues of runs in `out`, each given with the snapshot that it published last. Only files of which a run
    changed are written anew; a run whose catalogue cannot be read, or does not fit the others, is in none."""
    if isinstance(out, Path):
        (out / FOLDER).mkdir(exist_ok=True)
    before = {one.path.name: one.runs for one in joined_in(out)}
    held = {run: file for file, of in before.items() for run in of}
    by_file: dict[str, list[tuple[Run, str]]] = {file: [] for file in before}
    for one in runs:
        if one[0].name in held:
            by_file[held[one[0].name]].append(one)
    number = 0
    for one in runs:
        if one[0].name not in held:
            while len(by_file.setdefault(f"{number:05}.parquet", [])) >= PER_FILE:
                number += 1
            by_file[f"{number:05}.parquet"].append(one)
    for file, of in by_file.items():
        if of and before.get(file) != {run.name: snapshot for run, snapshot in of}:
            _write_rows(out / FOLDER / file, of)
    for path in _files(out):
        if not by_file.get(path.name):
            remove(path)


def _write_rows(path: Folder, runs: Sequence[tuple[Run, str]]) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    tables, schema, said = [], pa.schema([]), {}
    for (run, snapshot), table in zip(runs, each(_rows, runs, path), strict=True):
        if table is None:
            continue
        try:
            schema = pa.unify_schemas([schema, table.schema.remove_metadata()], promote_options="permissive")
        except pa.ArrowException:
            continue
        names = pa.array([run.name] * len(table), pa.string())
        tables.append(table.append_column("run", names).replace_schema_metadata(None))
        said[run.name] = snapshot
    if not tables:
        remove(path)
        return
    rows = pa.concat_tables(tables, promote_options="permissive").replace_schema_metadata({SAID: json.dumps(said)})
    written = pa.BufferOutputStream()
    pq.write_table(rows, written, compression="zstd")
    put(path, written.getvalue().to_pybytes())


def _rows(one: tuple[Run, str]) -> pa.Table | None:
    """The rows of a run's catalogue; None where it cannot be read."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    run, snapshot = one
    try:
        table = pq.read_table(pa.BufferReader((run.folder / "published" / snapshot / "items.parquet").read_bytes()))
        return table.select([name for name in table.column_names if name != "run"])
    except (OSError, pa.ArrowException):
        return None
