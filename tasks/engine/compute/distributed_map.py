"""Distribution of the coordinator's own work, such as the rays of an ingest, over workers."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import TypeVar

from tasks.engine.compute.cluster import SubmittedUnit
from tasks.engine.compute.connect import Compute
from tasks.engine.context import current_worker_name
from tasks.engine.progress import begin_stage, report_progress

log = logging.getLogger(__name__)

T = TypeVar("T")
R = TypeVar("R")
# Runs of items for each thread of the workers, so that none waits long for the last; how many of these are on their way; and
# the least items of a run, as each takes the block's geometry along.
RUNS_PER_THREAD, AHEAD, MIN_RUN_ITEMS = 4, 2, 8


def map_on_workers(compute: Future[Compute], function: Callable[[Sequence[T]], list[R]], items: Sequence[T]) -> list[R]:
    """Apply a function to slices of items on the workers, with their progress; return the results in order."""
    begin_stage("rays", len(items))
    workers = compute.result()
    length = max(MIN_RUN_ITEMS, -(-len(items) // (RUNS_PER_THREAD * max(1, workers.threads))))
    runs: deque[SubmittedUnit[tuple[list[R], dict[str, object]]]] = deque()
    found: list[R] = []

    def collect() -> None:
        results, about = runs.popleft().result()
        found.extend(results)
        report_progress("rays", len(results))
        log.debug("rays for %d of %d", len(found), len(items), extra={"stage": "ingest", **about})

    for first in range(0, len(items), length):
        # each takes the block's geometry along: no more on their way than keep the workers busy
        if len(runs) >= AHEAD * max(1, workers.threads):
            collect()
        runs.append(workers.submit(_timed_call, function, items[first : first + length]))
    while runs:
        collect()
    return found


def _timed_call(function: Callable[[Sequence[T]], list[R]], items: Sequence[T]) -> tuple[list[R], dict[str, object]]:
    """Call a function, and return its result with the worker and the duration."""
    start = time.time()
    found = function(items)
    return found, {
        "worker": current_worker_name(),
        "started": start,
        "seconds": {"cast": round(time.time() - start, 4)},
    }
