"""Ten thousand stores, one per block, asked together: what a query takes, joined and not, and what keeping that up takes.

Each store's catalogue is written by what publishes it, with as many facades as a small block has, on a grid of places; nothing
of it is copied. Seconds are of the processor, and of the clock, of a query in a process that has asked before; `command`: of
the whole command.

python -m benchmarks.city.many [--stores 10000] [--facades 20]
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from shapely import LineString

from benchmarks.timing import bytes_in, figures
from catalogs.published.columns import ROW_KEYS
from catalogs.published.items import write_items
from catalogs.published.merged_items import ITEMS_FOLDER, merge_run_items
from catalogs.published.runs import PublishedRun
from catalogs.query.execution import query

# Blocks stand so far apart, metres, in the frame of which they are.
APART_M, CRS, EAST, NORTH = 400.0, "EPSG:32635", 385_000.0, 6_671_000.0
WHERE = "floors >= 7 AND status = 'done'"
# A queried box, degrees: a few blocks.
BOX = (24.95, 60.16, 24.97, 60.17)


def write_store(out: Path, number: int, facades: int, side: int, snapshot: str = "S1") -> PublishedRun[Path]:
    """What a block that has published leaves for a query."""
    column, row = number % side, number // side
    x, y = EAST + APART_M * column, NORTH + APART_M * row
    folder = out / "blocks" / f"x{column}y{row}"
    write_published(folder, number, (x, y), facades, snapshot)
    return PublishedRun(folder, f"blocks/{folder.name}")


def write_published(folder: Path, number: int, corner: tuple[float, float], facades: int, snapshot: str) -> None:
    """Publish a catalogue of drawn facades as a block's newest snapshot."""
    random = np.random.default_rng([7, number])
    x, y = corner
    published = folder / "published" / snapshot
    published.mkdir(parents=True, exist_ok=True)
    rows = []
    for facade, (across, along, width, floors) in enumerate(random.random((facades, 4)).tolist()):
        at = x + 380 * across, y + 380 * along
        rows.append(
            dict.fromkeys(ROW_KEYS)
            | {
                "id": f"w{number * 1000 + facade}-0",
                "block": folder.name,
                "kind": "facade",
                "building": f"w{number * 1000 + facade}",
                "geometry": LineString([at, (at[0] + 5 + 20 * width, at[1])]),
                "street": f"street {y:.0f}",
                "role": "street",
                "height_m": 6 + 20 * floors,
                "width_m": 5 + 20 * width,
                "floors": 1 + int(8 * floors),
                "windows": int(40 * width * floors),
                "window_to_wall": round(0.5 * width, 3),
                "source": f"{facade % 15}.png",
                "status": "done",
                "updated": datetime(2026, 11, 1, tzinfo=UTC),
                "code_version": "1",
                "config_digest": f"{number:032x}",
            }
        )
    write_items(published / "items.parquet", rows, CRS)
    (published / "summary.json").write_text("{}")
    (folder / "current").write_text(snapshot + "\n")


def measure(stores: int, facades: int) -> dict[str, Any]:
    """Seconds by what is asked, of so many stores."""
    with tempfile.TemporaryDirectory() as name:
        out, side = Path(name), int(np.ceil(np.sqrt(stores)))
        written = _timed(lambda: [write_store(out, number, facades, side) for number in range(stores)])
        runs = [PublishedRun(folder, f"blocks/{folder.name}") for folder in (out / "blocks").iterdir()]
        few = min(stores, 500)
        apart = Path(name) / "apart"
        for number in range(few):
            write_store(apart, number, facades, side)
        query(apart)
        result = {
            "stores": stores,
            "facades": stores * facades,
            "written_a_store": {key: figures(value / stores) for key, value in written.items()},
            f"query_of_{few}_not_joined": _timed(lambda: query(apart, where=WHERE)),
            "join_all": _timed(lambda: merge_run_items(out, [(run, "S1") for run in runs])),
            "joined_mb": figures(bytes_in(out / ITEMS_FOLDER) / 1e6),
        }
        query(out, where="false")
        found: dict[str, int] = {}

        def ask(named: str, **asked: Any) -> Callable[[], None]:
            return lambda: found.update({named: len(query(out, **asked))})

        for named, asked in (("where", {"where": WHERE}), ("bbox", {"bbox": BOX}), ("all", {})):
            result[f"query_{named}"] = _timed(ask(named, **asked))
        changed = write_store(Path(name) / "anew", 0, facades, side, "S2")
        (changed.folder / "published" / "S2").rename(runs[0].folder / "published" / "S2")
        (runs[0].folder / "current").write_text("S2\n")
        result["query_where_one_published_since"] = _timed(ask("since", where=WHERE))
        again = [(run, "S2" if run == runs[0] else "S1") for run in runs]
        result["join_one_anew"] = _timed(lambda: merge_run_items(out, again))
        command = [sys.executable, "-m", "flows", "query", str(out), "--where", WHERE, "--format", "json"]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        clock = time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        result["command"] = {"processor_s": figures(spent), "clock_s": figures(time.perf_counter() - clock)}
        return result | {"found": found}


def _timed(act: Callable[[], object]) -> dict[str, float]:
    processor, clock = time.process_time(), time.perf_counter()
    act()
    return {
        "processor_s": figures(time.process_time() - processor),
        "clock_s": figures(time.perf_counter() - clock),
    }


def main() -> None:
    """Make the stores, ask them, print what that took as JSON."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--stores", type=int, default=10_000, help="how many [10000]")
    parser.add_argument("--facades", type=int, default=20, help="of each [20]")
    asked = parser.parse_args()
    load = round(os.getloadavg()[0], 1)
    print(json.dumps({"load": load, "cores": os.cpu_count()} | measure(asked.stores, asked.facades), indent=1))


if __name__ == "__main__":
    main()
