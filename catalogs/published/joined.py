"""The catalogues of many runs, joined: a query of ten thousand runs opens a hundred files.

OUT/items/N.parquet holds the rows of up to PER_FILE runs with their names in `run`, and says of itself of which snapshot of
which run they are: whatever happens, a file is true of what it says. It is a copy that is kept up: what a run has published
since is read of the run.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from catalogs.published.runs import Run

if TYPE_CHECKING:
    import pyarrow as pa

FOLDER, SAID = "items", b"streetloom:runs"
PER_FILE = 128


@dataclass(frozen=True)
class Joined:
    """A file of several runs' rows: its columns, and the snapshot of each run, by name, whose rows it holds."""

    path: Path
    columns: pa.Schema
    runs: dict[str, str]


def joined_in(out: Path) -> list[Joined]:
    """The joined files of a folder of runs; one that cannot be read is none."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    found = []
    for path in sorted((out / FOLDER).glob("*.parquet")):
        try:
            columns = pq.read_schema(path)
            runs = json.loads((columns.metadata or {})[SAID])
            found.append(Joined(path, columns.remove_metadata(), {str(run): str(of) for run, of in runs.items()}))
        except (OSError, ValueError, KeyError, AttributeError, pa.ArrowException):
            continue
    return found


def join_runs(out: Path, runs: Sequence[tuple[Run[Path], str]]) -> None:
    """Join the catalogues of runs in `out`, each given with the snapshot that it published last. Only files of which a run
    changed are written anew; a run whose catalogue cannot be read, or does not fit the others, is in none."""
    (out / FOLDER).mkdir(exist_ok=True)
    before = {one.path.name: one.runs for one in joined_in(out)}
    held = {run: file for file, of in before.items() for run in of}
    by_file: dict[str, list[tuple[Run[Path], str]]] = {file: [] for file in before}
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
    for path in (out / FOLDER).glob("*.parquet"):
        if not by_file.get(path.name):
            path.unlink(missing_ok=True)


def _write_rows(path: Path, runs: Iterable[tuple[Run[Path], str]]) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    tables, schema, said = [], pa.schema([]), {}
    for run, snapshot in runs:
        try:
            table = pq.read_table(run.folder / "published" / snapshot / "items.parquet")
            table = table.select([name for name in table.column_names if name != "run"])
            schema = pa.unify_schemas([schema, table.schema.remove_metadata()], promote_options="permissive")
        except (OSError, pa.ArrowException):
            continue
        names = pa.array([run.name] * len(table), pa.string())
        tables.append(table.append_column("run", names).replace_schema_metadata(None))
        said[run.name] = snapshot
    if not tables:
        path.unlink(missing_ok=True)
        return
    rows = pa.concat_tables(tables, promote_options="permissive").replace_schema_metadata({SAID: json.dumps(said)})
    temporary = path.with_name(f".{path.name}.tmp")
    pq.write_table(rows, temporary, compression="zstd")
    os.replace(temporary, path)
