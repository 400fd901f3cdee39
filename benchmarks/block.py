"""The embedded block, whole: seconds per facade and stage, per viewpoint and stage, peak memory, processor time, the rerun."""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, cast

import psutil

from benchmarks.process_usage import ROLES, add_used, measure_family_mb, user_environment
from tasks.engine.store.commits import read_newest_journal
from tasks.stages.streets.record import StreetRecord


def main() -> None:
    """Run the demo into a temporary folder, twice, and print what it took."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--exemplars", type=Path, help="facade photos instead of the painted exemplars")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        extra = ["--exemplars", str(options.exemplars)] if options.exemplars else []
        first, peak, processor = _demo(out, options.workers, extra)
        again, _, _ = _demo(out, options.workers, extra)
        store = out / "store"
        streets = [record for record in read_newest_journal(store, "streets") if record]
        result = {
            "benchmark": "block",
            "workers": options.workers,
            "exemplars": "given" if options.exemplars else "painted",
            "facades": first["facades_done"],
            "facades_failed": first["facades_failed"],
            "viewpoints": first["viewpoints"],
            "seconds_whole_command": first["seconds_command"],
            "seconds_run": first["seconds"],
            "processor_seconds": processor,
            "seconds_again": again["seconds_command"],
            "units_done_again": again["units_done"],
            "peak_memory_mb": peak,
            "seconds_per_exemplar": per_stage(read_newest_journal(store, "exemplars")),
            "seconds_per_facade": per_stage(read_newest_journal(store, "facades")),
            "seconds_per_viewpoint": per_stage(read_newest_journal(store, "viewpoints"))
            | {"commit": _quantiles([s for record in streets for s in cast(StreetRecord, record)["commits"]])},
            "seconds_per_street": per_stage(streets),
            "store_mb": round(sum(f.stat().st_size for f in store.rglob("*") if f.is_file()) / 1e6, 1),
            "glb_mb": round(Path(first["outputs"]["glb"][0]).stat().st_size / 1e6, 1),
            "atlas_digest": first["atlas_digest"],
        }
    print(json.dumps(result, indent=1))


def per_stage(records: Iterable[Mapping[str, Any] | None]) -> dict[str, dict[str, float]]:
    """Median, largest and total seconds of every stage over the journal's records."""
    stages: dict[str, list[float]] = {}
    for record in records:
        for stage, seconds in (record or {}).get("seconds", {}).items():
            stages.setdefault(stage, []).append(seconds)
    return {stage: _quantiles(values) for stage, values in stages.items()}


def _quantiles(values: list[float]) -> dict[str, float]:
    return {
        "count": len(values),
        "median": round(statistics.median(values), 4),
        "max": round(max(values), 4),
        "total": round(sum(values), 2),
    }


def _demo(out: Path, workers: int, extra: list[str]) -> tuple[dict[str, Any], float, dict[str, float]]:
    """One run of the demo as a command: its summary, the peak of the memory of all its processes in MB, and their processor
    seconds by what they do."""
    start = time.monotonic()
    command = [sys.executable, "-m", "flows", "demo", "--out", str(out), "--workers", str(workers), "--json", *extra]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=user_environment())
    peak = 0.0
    used: dict[int, tuple[str, float]] = {}

    def watch() -> None:
        nonlocal peak
        root = psutil.Process(process.pid)
        while process.poll() is None:
            peak = max(peak, measure_family_mb(process.pid))
            add_used(root, used)
            time.sleep(0.25)

    watcher = threading.Thread(target=watch)
    watcher.start()
    output, _ = process.communicate()
    watcher.join()
    if process.returncode not in (0, 1):
        raise SystemExit(f"the demo ended with {process.returncode}; its error is above")
    summary = json.loads(output.strip().splitlines()[-1])
    processor = dict.fromkeys(ROLES, 0.0)
    for role, seconds in used.values():
        processor[role] = round(processor[role] + seconds, 1)
    return summary | {"seconds_command": round(time.monotonic() - start, 1)}, round(peak), processor


if __name__ == "__main__":
    main()
