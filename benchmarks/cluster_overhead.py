"""What a cluster loses to ordering, commits and the coordinator: units sleep for the seconds that they took in a finished run.

`python -m benchmarks.cluster_overhead OUT [--workers 2 4 8]` prints JSON. OUT is the folder of a finished run of a block, such
as out/demo. Scheduler, workers, keys, batches, journal and commits are real; nothing is computed, and units commit their
record only, so that a commit is smaller than a real one. seconds: wall time of all stages; least: what no order could beat, of
each stage the sum of its units over the workers, or its longest piece if that is more; lost: the share of seconds beyond that;
coordinator: processor seconds of this process a unit; workers_served: at so many workers the coordinator alone would be busy
all the time.
"""

from __future__ import annotations

import argparse
import json
import shutil
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any
from unittest import mock

from icechunk import ForkSession

from catalogs.block.reader import Block, read_block
from facade_core.plan.plan_tables import read_plan
from flows import block as flow
from flows.submission import submit_to_pool
from tasks.engine.compute.connect import connect
from tasks.engine.pending import find_pending_units
from tasks.engine.run import Run
from tasks.engine.run_key import create_run
from tasks.engine.store.commits import read_newest_journal
from tasks.engine.unit import UnitGroup
from tasks.stages.ingest.task import ingest_block
from tasks.stages.order import STAGE_NAMES, STAGES_IN_ORDER
from tasks.stages.streets import task as street_task
from tasks.stages.streets.worker import COMMIT_INTERVAL_S

WORKERS = (2, 4, 8)


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.cluster_overhead",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("out", type=Path, help="folder of a finished run of a block")
    parser.add_argument("--workers", type=int, nargs="+", default=WORKERS)
    options = parser.parse_args()
    print(json.dumps(measure(options.out, options.workers), indent=1))


def measure(finished: Path, workers: Sequence[int]) -> dict[str, Any]:
    """Measure a sleeping run for each number of workers."""
    block = read_block(next((finished / "input").glob("*.yaml")))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        records = folder / "records.json"
        records.write_text(
            json.dumps({stage: read_newest_journal(finished / "store", stage) for stage in STAGE_NAMES}),
            encoding="utf-8",
        )
        first = create_run(block, folder / "ingested")
        ingest_block.fn(first, block)
        rows = []
        for count in workers:
            out = folder / f"out-{count}"
            shutil.copytree(folder / "ingested", out)
            rows.append(_sleeping_run(create_run(block, out), block, records, count))
    return {"benchmark": "cluster_overhead", "block": block.name, "runs": rows}


def _sleeping_run(run: Run, block: Block, records: Path, workers: int) -> dict[str, Any]:
    """Run all stages with units that sleep, and tell wall time, its bound, and the coordinator's processor time."""
    held = _load_records(records)
    outline = ingest_block.fn(run, block)
    run = replace(run, ingested=outline.ingested)
    least, units = 0.0, 0
    with (
        connect(workers, None, run.out) as compute,
        ThreadPoolExecutor(flow.MAX_CONCURRENT_TASKS) as pool,
        mock.patch.object(street_task, "process_viewpoints", partial(sleep_viewpoints, records)),
        mock.patch.object(street_task, "write_street_texels", partial(sleep_street, records)),
    ):
        submit = submit_to_pool(pool)
        started, processor = time.perf_counter(), time.process_time()
        for stage in STAGES_IN_ORDER:
            if stage.part_of is not None:
                continue
            if stage.units is None:
                flow.run_streets(run, outline, compute, None, submit)
                chains = [
                    sum(map(_seconds, [held["streets"][street], *_viewpoint_records(run, records, street)]))
                    for street in range(len(outline.streets))
                ]
                units += len(outline.streets) + sum(outline.viewpoints)
                least += max(sum(chains) / workers, max(chains, default=0.0))
                continue
            pending = find_pending_units(run, block, stage)
            pieces = [sum(_seconds(held[stage.stage][unit.index]) for unit in piece) for piece in pending.pieces]
            units += sum(map(len, pending.pieces))
            least += max(sum(pieces) / workers, max(pieces, default=0.0))
            sleeping = replace(stage, function=partial(sleep_units, records, stage.stage))
            flow.run_stage(run, replace(pending, stage=sleeping), compute, submit)
        seconds, processor = time.perf_counter() - started, time.process_time() - processor
    return {
        "workers": workers,
        "units": units,
        "seconds": round(seconds, 1),
        "least": round(least, 1),
        "lost": round(1 - least / seconds, 3),
        "coordinator": round(processor / units, 4),
        "workers_served": round(sum(map(_seconds, _all_records(held))) / processor, 1),
    }


def sleep_units(records: Path, stage: str, run: Run, fork: ForkSession, piece: UnitGroup) -> tuple[Any, Any]:
    """Sleep as long as units took, and return their records."""
    held = _load_records(records)[stage]
    made = {unit.index: {**held[unit.index], "key": unit.key, "unit": unit.name} for unit in piece}
    time.sleep(sum(map(_seconds, made.values())))
    return fork, made


def sleep_viewpoints(
    records: Path, run: Run, fork: ForkSession, street: int, steps: Sequence[int], key: str
) -> tuple[Any, Any]:
    """Sleep as long as viewpoints took, for as many as are committed together."""
    begun = time.time()
    made: list[dict[str, Any]] = []
    own = _viewpoint_records(run, records, street)
    for step in steps:
        if made and time.time() - begun > COMMIT_INTERVAL_S:
            break
        time.sleep(_seconds(own[step]))
        made.append(own[step])
    return fork, made


def sleep_street(records: Path, run: Run, fork: ForkSession, street: int, steps: int, key: str) -> tuple[Any, Any]:
    """Sleep as long as the end of a street took."""
    held = _load_records(records)["streets"][street]
    time.sleep(_seconds(held))
    return fork, held


def _viewpoint_records(run: Run, records: Path, street: int) -> list[dict[str, Any]]:
    held = _load_records(records)["viewpoints"]
    return [held[viewpoint] for viewpoint in _viewpoints_of_streets(run)[street]]


@cache
def _viewpoints_of_streets(run: Run) -> list[list[int]]:
    from facade_core.atlas.store import BRANCH, open_repository

    plan = read_plan(open_repository(run.store).readonly_session(BRANCH))
    return [[one.id for one in plan.street_viewpoints(street)] for street in range(len(plan.streets))]


@cache
def _load_records(path: Path) -> dict[str, list[dict[str, Any]]]:
    return json.loads(path.read_text(encoding="utf-8"))


def _all_records(held: dict[str, list[dict[str, Any]]]) -> list[dict[str, Any]]:
    return [record for records in held.values() for record in records if record]


def _seconds(record: dict[str, Any]) -> float:
    """Return how long a unit took."""
    return sum(record.get("seconds", {}).values())


if __name__ == "__main__":
    main()
