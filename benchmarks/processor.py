"""Processor seconds of the demo's stages, one unit after the other in one process, without a server and a cluster.

NUMBA_CACHE_DIR=EMPTY_FOLDER shows what compiling takes on a first run.
"""

from __future__ import annotations

import argparse
import cProfile
import json
import pstats
import statistics
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

from tasks.engine.compute.worker_setup import limit_threads

# Functions that --profile tells of, by their own and by all time.
TOLD = 45


def main() -> None:
    """Run the demo's stages, or those of a block, and print the processor seconds of each."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--block", type=Path, help="another block than the demo's")
    parser.add_argument("--out", type=Path, help="where to; what is done there is not done again (a temporary folder)")
    parser.add_argument("--until", help="the last stage to do, such as facades")
    parser.add_argument(
        "--profile", action="append", default=[], help="one of the names printed; its functions are told on stderr"
    )
    parser.add_argument("--every", type=int, default=1, help="of the units only each so many-th: for a look (1)")
    options = parser.parse_args()
    with nullcontext(options.out) if options.out else tempfile.TemporaryDirectory() as folder:
        print(
            json.dumps(measured(Path(folder), options.block, options.until, options.every, options.profile), indent=1)
        )


def measured(out: Path, block_file: Path | None, until: str | None, every: int, profiled: list[str]) -> dict[str, Any]:
    """Processor seconds by stage, with the imports before and what the coordinator does; of units how many, and the median,
    largest and sum."""
    limit_threads()
    begun = time.process_time()
    clock = Clock(profiled)
    from catalogs.block.reader import read_block
    from facade_core.kernel_warmup import WARMUPS
    from tasks.engine.compute.serial import SerialCompute
    from tasks.engine.fan_out import process_batch
    from tasks.engine.pending import find_pending_units
    from tasks.engine.run_key import create_run
    from tasks.examples.demo import write_demo
    from tasks.publish.task import publish_block
    from tasks.stages.ingest.task import ingest_block
    from tasks.stages.order import STAGES_IN_ORDER

    class Timed(SerialCompute):
        def submit(self, function: Callable[..., Any], *args: Any, **keys: Any) -> Any:
            return super().submit(clock.timed(function), *args, **keys)

    out.mkdir(parents=True, exist_ok=True)
    clock.took("imports", time.process_time() - begun)
    for part in WARMUPS:
        clock.run(f"compile {part.__name__}", part)
    source = block_file or clock.run("paint", write_demo, out / "input")
    block, compute = read_block(source), Timed()
    run = create_run(block, out)
    outline = clock.run("ingest", ingest_block.fn, run, block)
    run = replace(run, ingested=outline.ingested)
    for kind in STAGES_IN_ORDER:
        clock.stage = kind.stage
        due = clock.run("keys", find_pending_units, run, block, kind)
        for piece in due.pieces[::every]:
            clock.run("commits", process_batch.fn, run, kind.stage, "1", kind.function, [piece], compute)
        if kind.stage == until:
            break
    else:
        clock.run("publish", publish_block.fn, run, source)
    clock.tell_functions()
    return {"benchmark": "processor"} | clock.told()


class Clock:
    """Processor seconds of what is called, by name, without those of what it calls that is timed itself."""

    def __init__(self, profiled: list[str]) -> None:
        self.stage = ""
        self._profiled = profiled
        self._profiles: dict[str, cProfile.Profile] = {}
        self._seconds: dict[str, list[float]] = defaultdict(list)
        self._inner = 0.0

    def took(self, name: str, seconds: float) -> None:
        self._seconds[name].append(seconds)

    def run(self, name: str, function: Callable[..., Any], *arguments: Any) -> Any:
        outer, self._inner = self._inner, 0.0
        profile = None
        if name in self._profiled:
            profile = self._profiles.setdefault(name, cProfile.Profile(time.process_time))
        begun = time.process_time()
        if profile:
            profile.enable()
        try:
            return function(*arguments)
        finally:
            seconds = time.process_time() - begun
            if profile:
                profile.disable()
            self.took(name, seconds - self._inner)
            self._inner = outer + seconds

    def timed(self, function: Callable[..., Any]) -> Callable[..., Any]:
        return lambda *arguments: self.run(f"{self.stage}: {function.__name__}", function, *arguments)

    def told(self) -> dict[str, Any]:
        """Seconds by name, and their sum."""
        stages = {
            name: {
                "count": len(of),
                "median": round(statistics.median(of), 3),
                "max": round(max(of), 3),
                "total": round(sum(of), 2),
            }
            for name, of in self._seconds.items()
        }
        return {"seconds": stages, "all": round(sum(map(sum, self._seconds.values())), 1)}

    def tell_functions(self) -> None:
        """Print what is profiled, function by function."""
        for name, profile in self._profiles.items():
            print(name, file=sys.stderr)
            for order in ("tottime", "cumulative"):
                pstats.Stats(profile, stream=sys.stderr).sort_stats(order).print_stats(TOLD)


if __name__ == "__main__":
    main()
