"""Queries on a catalogue of a million facades: `python -m benchmarks.query` prints one JSON object.

The catalogue is that of a city: runs of 5,000 facades with random values, merged. Seconds of `catalogs.query.query` in a
process that has its libraries loaded, median of --repeats: a filter on two columns, one facade by its id, and a box.
"""

from __future__ import annotations

import argparse
import json
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from catalogs.published.columns import COLUMNS, arrow_type
from catalogs.published.file_list import write_file_list
from catalogs.published.merged_items import merge_run_items
from catalogs.published.runs import PublishedRun

ROWS = 1_000_000
RUN = 5_000  # facades of a run


def write_city(out: Path, rows: int) -> None:
    """The catalogues of runs with `rows` facades of a city, merged as `streetloom city` merges them."""
    rng = np.random.default_rng(0)
    runs = []
    for start in range(0, rows, RUN):
        run = PublishedRun(out / "blocks" / f"b{start // RUN}", f"blocks/b{start // RUN}")
        _write_run(run.folder, start, min(RUN, rows - start), rng)
        runs.append((run, "S"))
    merge_run_items(out, runs)


def _write_run(folder: Path, start: int, count: int, rng: np.random.Generator) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq
    import shapely

    published = folder / "published" / "S"
    published.mkdir(parents=True)
    schema = pa.schema([pa.field(column.name, arrow_type(column)) for column in COLUMNS])
    x, y = 24.9 + 0.2 * rng.random(count), 60.15 + 0.1 * rng.random(count)
    ends = np.stack([np.stack([x, y], 1), np.stack([x + 2e-4, y], 1)], 1)
    known: dict[str, Any] = {
        "id": [f"w{start + i}-0" for i in range(count)],
        "kind": ["facade"] * count,
        "geometry": shapely.to_wkb(shapely.linestrings(ends)),
        "xmin": x, "ymin": y, "xmax": x + 2e-4, "ymax": y,
        "floors": rng.integers(1, 12, count),
    }  # fmt: skip
    table = pa.table([_column(field, known, count, rng) for field in schema], schema=schema)
    pq.write_table(table, published / "items.parquet", compression="zstd")
    write_file_list(published, None)
    (folder / "current").write_text("S\n")


def _column(field: Any, known: dict[str, Any], count: int, rng: np.random.Generator) -> Any:
    import pyarrow as pa

    if field.name in known:
        return pa.array(known[field.name], field.type)
    if pa.types.is_integer(field.type):
        return pa.array(rng.integers(0, 50, count), field.type)
    if pa.types.is_floating(field.type):
        return pa.array(rng.random(count), field.type)
    if pa.types.is_timestamp(field.type):
        return pa.array(rng.integers(1_700_000_000, 1_760_000_000, count) * 1_000_000, field.type)
    return pa.array([f"{field.name} {i}" for i in rng.integers(0, 200, count)], field.type)


def main() -> None:
    """Print the report."""
    from catalogs.query.execution import query

    parser = argparse.ArgumentParser(prog="benchmarks.query", description=__doc__)
    parser.add_argument("--rows", type=int, default=ROWS)
    parser.add_argument("--repeats", type=int, default=9)
    options = parser.parse_args()
    asked: dict[str, dict[str, Any]] = {
        "floors >= 11 and occluded > 0.99": {"where": "floors >= 11 and occluded > 0.99"},
        "id = 'w4321-0'": {"where": "id = 'w4321-0'"},
        "a box of 500 m": {"bbox": (24.95, 60.17, 24.959, 60.1745)},
    }
    report: dict[str, Any] = {"benchmark": "query", "rows": options.rows}
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch) / "out"
        write_city(out, options.rows)
        report["megabytes"] = round(sum(one.stat().st_size for one in (out / "items").iterdir()) / 1e6, 1)
        for name, condition in asked.items():
            query(out, **condition)  # libraries, and the file into memory
            seconds, used = [], []
            for _ in range(options.repeats):
                begun, cpu = time.perf_counter(), time.process_time()
                found = len(query(out, **condition))
                seconds.append(time.perf_counter() - begun)
                used.append(time.process_time() - cpu)
            report[name] = {
                "found": found,
                "seconds": round(statistics.median(seconds), 3),
                "cpu_seconds": round(statistics.median(used), 3),
            }
    print(json.dumps(report))


if __name__ == "__main__":
    main()
