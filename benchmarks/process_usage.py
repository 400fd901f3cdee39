"""One run of the command in a process of its own, with the clock on, and what it says of orchestration."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from benchmarks.orchestration.shares import Unit, groups, lost, units_of, window
from benchmarks.orchestration.trace import Span

# Seconds between two looks at the processor time of the run's processes.
LOOK_S = 0.5
ROLES = ("coordinator", "server", "workers")


def measured(block: Path, out: Path, workers: int) -> dict[str, Any]:
    """Run `block` into the fresh folder `out` and measure it: a JSON object."""
    load = os.getloadavg()[0]
    traced = out.with_suffix(".json")
    # not -m: workers would import the module that is run once more
    command = [sys.executable, "-c", "from benchmarks.orchestration.trace import main; main()", str(traced)]
    command += ["run", str(block), "--out", str(out), "--workers", str(workers), "--json"]
    environment = {k: v for k, v in os.environ.items() if not k.startswith("PREFECT_")}
    begun = time.time()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    looks: list[tuple[float, dict[str, float]]] = []
    watcher = threading.Thread(target=_watch, args=(process, looks))
    watcher.start()
    output, _ = process.communicate()
    ended = time.time()
    watcher.join()
    if process.returncode not in (0, 1):  # 1: a unit of the map is set aside, the rest is done
        raise SystemExit(f"the run ended with {process.returncode}; its error is above")
    summary = json.loads(output.strip().splitlines()[-1])
    spans = [(what, start, end) for what, start, end in json.loads(traced.read_text())]
    units = units_of(out / "store")
    return {
        "workers": workers,
        "load_before": round(load, 2),
        "load_after": round(os.getloadavg()[0], 2),
        "facades": summary["facades_done"],
        "viewpoints": summary["viewpoints"],
        "failures": summary["failures"],
        "atlas_digest": summary["atlas_digest"],
        "seconds_command": round(ended - begun, 2),
        "seconds_to_first_unit": round(window(units, spans)[0] - begun, 2),
        "start_up_s": start_up(begun, units, spans),
        "publish_s": _lasting(spans, "publish"),
        "shut_down_s": round(ended - max(end for what, _, end in spans if what == "publish"), 2),
        **_costs(units, spans, workers),
        "cpu_s": _cpu(looks, window(units, spans)),
    }


def start_up(begun: float, units: Sequence[Unit], spans: Sequence[Span]) -> dict[str, Any]:
    """What passed between the command and its first unit, in order, and how long what overlaps took: server, cluster, ingest.

    The server starts beside the imports, the cluster beside the ingest.
    """
    starts = {what: start for what, start, _ in reversed(spans)}
    ends = {what: end for what, _, end in reversed(spans)}
    marks = {
        "interpreter": begun,
        "first_read_of_block": starts["command"],
        "imports": starts["server"],
        "waiting_for_server": starts["ready"],
        "flow_engine": ends["ready"],
        "second_read_of_block": starts["flow"],
        "cluster_and_ingest": starts["cluster"],
        "first_unit_on_its_way": max(ends["cluster"], ends["ingest"]),
    }
    times = [*marks.values(), min(u.start for u in units)]
    overlapping = {
        "server": ends["ready"] - starts["server"],
        "cluster": ends["cluster"] - starts["cluster"],
        "ingest": ends["ingest"] - starts["ingest"],
    }
    return {name: round(after - at, 2) for name, at, after in zip(marks, times, times[1:], strict=False)} | {
        "overlapping": {name: round(seconds, 2) for name, seconds in overlapping.items()}
    }


def _costs(units: Sequence[Unit], spans: Sequence[Span], workers: int) -> dict[str, Any]:
    start, end = window(units, spans)
    computed = sum(u.end - u.start - u.prepare for u in units)
    causes = lost(units, spans, workers)
    total = sum(causes.values())
    stages = groups(units)
    calls = {what: [e - s for w, s, e in spans if w == what] for what in ("task", "session", "commit", "orders")}
    return {
        "window_s": round(end - start, 2),
        "stages_s": {name: round(e - s, 2) for name, (s, e) in stages.items()},
        "units": dict(Counter(u.group for u in units)),
        "computed_s": round(computed, 2),
        "io_s": round(sum(u.io for u in units), 2),
        "lost_s": {cause: round(s, 2) for cause, s in causes.items()} | {"all": round(total, 2)},
        "orchestration_share": round(total / computed, 4),
        "without_barriers": round((total - causes["barrier"]) / computed, 4),
        "calls": {
            what: {"count": len(s), "median_ms": round(1000 * statistics.median(s), 1), "total_s": round(sum(s), 2)}
            for what, s in calls.items()
            if s
        },
    }


def _lasting(spans: Sequence[Span], what: str) -> float:
    return round(sum(end - start for name, start, end in spans if name == what), 2)


def _watch(process: subprocess.Popen, looks: list[tuple[float, dict[str, float]]]) -> None:
    """Look at the processor seconds of a process and its descendants by role until it ends; the dead keep what they had."""
    held: dict[int, tuple[str, float]] = {}
    root = psutil.Process(process.pid)
    while process.poll() is None:
        add_used(root, held)
        total: dict[str, float] = dict.fromkeys(ROLES, 0.0)
        for role, seconds in held.values():
            total[role] += seconds
        looks.append((time.time(), total))
        time.sleep(LOOK_S)


def add_used(root: psutil.Process, used: dict[int, tuple[str, float]]) -> None:
    """What each of a process and its descendants does, and the processor seconds that it has used, by its number: what was
    written of those that have ended stays."""
    try:
        family = [root, *root.children(recursive=True)]
    except psutil.NoSuchProcess:
        return
    for one in family:
        try:
            times = one.cpu_times()
            role = used[one.pid][0] if one.pid in used else role_of(one, root)
        except psutil.Error:
            continue
        used[one.pid] = (role, times.user + times.system)


def role_of(process: psutil.Process, root: psutil.Process) -> str:
    if process.pid == root.pid:
        return "coordinator"
    return "workers" if "multiprocessing" in " ".join(process.cmdline()) else "server"


def _cpu(looks: Sequence[tuple[float, Mapping[str, float]]], during: tuple[float, float]) -> dict[str, float]:
    """Processor seconds of each role between two times; with one worker the coordinator computes."""
    times = [at for at, _ in looks]
    return {
        role: round(float(np.diff(np.interp(during, times, [total[role] for _, total in looks]))[0]), 2)
        for role in ROLES
    }
