"""View of a Dask scheduler: its workers and their units, polled in one call."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from tasks.engine.compute.timeouts import Timeouts

if TYPE_CHECKING:
    from distributed import Client, Scheduler

# Of the memory that workers have, what units may declare together; the rest is for libraries and a run's plan.
UNITS_SHARE = 0.6
# Memory of a worker that was started without a limit, in bytes.
DEFAULT_WORKER_MEMORY = 2**33

log = logging.getLogger(__name__)

# The fields of a `Worker`, in their order.
WorkerFields = tuple[str, int, int, bool, bool, float]
# Fields of the workers by address, address of the worker of each unit by the unit's key, keys of running units.
QueryAnswer = tuple[dict[str, WorkerFields], dict[str, str], list[str]]


@dataclass(frozen=True)
class WorkerState:
    """State of a Dask worker at one poll.

    Attributes
    ----------
    name : its own name.
    threads : units that it runs at once.
    memory : limit in bytes, 0 for none.
    nanny : whether a nanny restarts it.
    running : whether it accepts units.
    last_seen : the scheduler's time of its last heartbeat.
    """

    name: str
    threads: int
    memory: int = 0
    nanny: bool = False
    running: bool = True
    last_seen: float = 0.0

    @property
    def share(self) -> int:
        """Return the bytes that units on it may declare."""
        return int((self.memory or DEFAULT_WORKER_MEMORY) * UNITS_SHARE)


@dataclass(frozen=True)
class SchedulerView:
    """State of a scheduler at one poll.

    Attributes
    ----------
    workers : by address.
    assigned : address of the worker of each unit, by the unit's key.
    executing : keys of running units.
    """

    workers: dict[str, WorkerState] = field(default_factory=dict)
    assigned: dict[str, str] = field(default_factory=dict)
    executing: frozenset[str] = frozenset()


class WorkerRegistry:
    """Registry of workers over several polls: silent ones, stuck ones, and how long there has been none.

    Attributes
    ----------
    view : last view.
    stuck : addresses of workers that run a unit that does not end.
    empty : seconds without any other worker, by the time in which this process was awake.
    """

    def __init__(self, view: SchedulerView, patience: Timeouts) -> None:
        self.view = view
        self._patience = patience
        self.stuck: set[str] = set()
        self.empty = 0.0
        # address -> seconds since it gave a sign; below zero before the first
        self._silent = dict.fromkeys(view.workers, self._new)

    @property
    def _new(self) -> float:
        """Return the silence that a new worker starts with, seconds: below zero, as it imports modules first."""
        return self._patience.worker_silence - self._patience.worker_start

    @property
    def usable(self) -> dict[str, WorkerState]:
        """Return the workers that may receive units, by address."""
        limit = self._patience.worker_silence
        heard = {address for address, seconds in self._silent.items() if seconds < limit} - self.stuck
        return {address: worker for address, worker in self.view.workers.items() if address in heard}

    def update(self, view: SchedulerView, awake: float) -> None:
        """Update the registry with a view, so many seconds after the previous one."""
        known, self.view = self.view.workers, view
        before, self._silent = self._silent, {}
        for address, worker in view.workers.items():
            seen = worker.running and address in known and worker.last_seen != known[address].last_seen
            silent = before.get(address, self._new)
            self._silent[address] = 0.0 if seen else silent + awake
            if not seen and silent < self._patience.worker_silence <= silent + awake:
                log.warning("worker %s at %s gives no sign; its units are done elsewhere", worker.name, address)
        self.empty = 0.0 if view.workers.keys() - self.stuck else self.empty + awake


def poll_scheduler(client: Client, timeout: float) -> SchedulerView:
    """Poll a scheduler. Raises TimeoutError if it does not answer in time, OSError if it is gone."""
    answer: QueryAnswer = client.sync(client._run_on_scheduler, scheduler_query(), callback_timeout=timeout)  # noqa: SLF001
    workers, given, executing = answer
    return SchedulerView(
        {address: WorkerState(*fields) for address, fields in workers.items()}, given, frozenset(executing)
    )


def restart_workers(client: Client, workers: dict[str, WorkerState]) -> None:
    """Restart workers, by address, that are busy with a unit that nobody waits for."""
    for address, worker in workers.items():
        fate = "started anew" if worker.nanny else "given up; start it anew"
        log.warning("worker %s at %s does not end its unit: it is %s", worker.name, address, fate)
    if nursed := [address for address, worker in workers.items() if worker.nanny]:
        try:
            client.restart_workers(nursed, raise_for_error=False)
        except Exception as error:  # they stay left out
            log.warning("workers cannot be started anew: %s", error)


def scheduler_query() -> Callable[[Scheduler], QueryAnswer]:
    """Return the function that a scheduler runs to report its workers and their units."""

    def ask(
        dask_scheduler: Scheduler,
    ) -> QueryAnswer:  # sent by value, being local: a scheduler need not have this code
        workers: dict[str, WorkerFields] = {}
        given: dict[str, str] = {}
        executing: list[str] = []
        for address, worker in dask_scheduler.workers.items():
            workers[address] = (
                str(worker.name),
                worker.nthreads,
                worker.memory_limit or 0,
                bool(worker.nanny),
                worker.status.name == "running",
                worker.last_seen,
            )
            given.update({str(unit.key): address for unit in worker.processing})
            executing.extend(str(unit.key) for unit in worker.executing)
        return workers, given, executing

    return ask
