"""Execution of units on the workers of a Dask scheduler.

Dask places units, steals work, and reruns the units of lost workers. This module adds what Dask lacks:

- Dask waits without limit for a worker, and for a scheduler that does not answer. Here the run ends.
- Dask suspects all units of a worker that dies, also those that only wait there. Here each is run once more, by itself.
- Dask bounds no duration. Here a worker exits when a unit exceeds its limit; Dask reruns that unit elsewhere.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from functools import partial
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar, cast
from uuid import uuid4

from facade_core.core.errors import FacadeError, MachineError
from tasks.engine.compute.worker_setup import LOG_TOPIC, run_on_worker

if TYPE_CHECKING:
    from distributed import Client, Future

log = logging.getLogger(__name__)

R = TypeVar("R")
R_co = TypeVar("R_co", covariant=True)

# Of the memory that workers have, what units may declare together; the rest is for libraries and a run's plan.
UNITS_SHARE = 0.6
# Memory of a worker that was started without a limit, in bytes.
DEFAULT_WORKER_MEMORY = 2**33

RUN_TIMEOUT_MESSAGE = "the run took longer than its deadline; run again to go on from here"


class ClusterGoneError(MachineError):
    """The scheduler, or its last worker, is gone. Committed units stay."""

    def __init__(self, message: str = "the Dask cluster went away; run again to go on from here") -> None:
        super().__init__(message)


class WorkersDiedError(FacadeError):
    """Every worker that ran a unit died."""


class UnitTimeoutError(FacadeError):
    """A unit did not end in time on any worker."""


class RunTimeoutError(MachineError):
    """A run did not end in time. Committed units stay."""


@dataclass(frozen=True)
class Timeouts:
    """Timeouts in seconds.

    Attributes
    ----------
    connect : first answer of a scheduler.
    first_worker : first worker of a scheduler.
    poll_interval : time between two polls of the scheduler.
    silence : no answer until the scheduler is given up.
    empty : no worker until the run ends; a restarted worker needs some time.
    unit : duration of a unit, many times that of the longest known.
    """

    connect: float = 8.0
    first_worker: float = 30.0
    poll_interval: float = 2.0
    silence: float = 300.0
    empty: float = 120.0
    unit: float = 1800.0


DEFAULT_TIMEOUTS = Timeouts()


class SubmittedUnit(Protocol[R_co]):
    """Protocol of a unit that was submitted to any kind of compute."""

    def result(self) -> R_co:
        """Return the result of the unit, or raise its error."""
        ...


@dataclass(eq=False)
class ClusterUnit(Generic[R_co]):
    """A unit on a cluster, with the bytes that it declares. Its result leaves the cluster with its last reference."""

    cluster: Cluster
    call: tuple[Callable[..., R_co], *tuple[object, ...]]
    memory: int
    future: Future[R_co] = field(init=False)

    def __post_init__(self) -> None:
        self.start()

    def start(self) -> None:
        """Submit the unit to Dask."""
        self.future = self.cluster.submit_call(self.call)

    def is_suspect(self) -> bool:
        """Report whether workers died that ran the unit, or had it next."""
        from distributed import KilledWorker

        return self.future.status == "error" and isinstance(self.future.exception(), KilledWorker)

    def result(self) -> R_co:
        """Return the result of the unit.

        Raises
        ------
        WorkersDiedError : its workers died, and did so again without another suspect.
        UnitTimeoutError : it exceeded its limit.
        ClusterGoneError : the cluster is gone.
        RunTimeoutError : the run exceeded its deadline.
        """
        return self.cluster.wait_for_result(self)


class Cluster:
    """Runs units on the workers of a Dask scheduler, until a deadline by time.monotonic() if there is one."""

    def __init__(self, client: Client, until: float | None = None, timeouts: Timeouts = DEFAULT_TIMEOUTS) -> None:
        self._client, self._until, self._timeouts = client, until, timeouts
        self._polling = threading.Lock()  # holds for the next three lines
        self._workers: dict[str, dict[str, Any]] = {}
        self._polled = -float("inf")
        self._lost_since: float | None = None
        self._suspects = threading.Lock()
        self._timed_out: set[str] = set()
        client.subscribe_topic(LOG_TOPIC, self._handle_event)

    @property
    def memory(self) -> int:
        """Return the bytes that units on all workers may declare together."""
        self._check()
        limits = [worker["memory_limit"] or DEFAULT_WORKER_MEMORY for worker in self._workers.values()]
        return sum(int(limit * UNITS_SHARE) for limit in limits)

    @property
    def threads(self) -> int:
        """Return the number of units that run at once."""
        self._check()
        return sum(worker["nthreads"] for worker in self._workers.values())

    def submit(self, function: Callable[..., R], *args: object, memory: int = 0) -> ClusterUnit[R]:
        """Submit a unit that takes `memory` bytes."""
        return ClusterUnit(self, (function, *args), memory)

    def submit_call(self, call: tuple[Callable[..., R], *tuple[object, ...]]) -> Future[R]:
        """Submit a function with its arguments to Dask."""
        key = f"{getattr(call[0], '__name__', 'unit')}-{uuid4().hex}"
        try:
            return self._client.submit(run_on_worker, self._timeouts.unit, *call, key=key, pure=False)
        except Exception as error:
            if self._client.status == "running":
                raise
            raise ClusterGoneError from error

    def iterate_completed(self, started: Iterable[SubmittedUnit[R]]) -> Iterator[SubmittedUnit[R]]:
        """Iterate over units as they complete, those whose workers died last."""
        units = cast(list[ClusterUnit[R]], list(started))  # a cluster submits no others
        suspects = []
        ended: SimpleQueue[ClusterUnit[R]] = SimpleQueue()
        for unit in units:
            unit.future.add_done_callback(partial(_put, ended, unit))
        count = len(units)
        del started, units
        for _ in range(count):
            unit = self._take(ended)
            if unit.is_suspect():
                suspects.append(unit)
            else:
                yield unit
            del unit
        yield from suspects

    def wait_for_result(self, unit: ClusterUnit[R]) -> R:
        """Wait for the result of a unit; run the unit again by itself if its workers died."""
        from distributed import KilledWorker

        is_alone = False
        with ExitStack() as alone:
            while True:
                if not unit.future.done():
                    ended: SimpleQueue[ClusterUnit[R]] = SimpleQueue()
                    unit.future.add_done_callback(partial(_put, ended, unit))
                    self._take(ended)
                if not unit.is_suspect():
                    # its result may be lost with its worker, and the worker that redoes it with another unit
                    with suppress(KilledWorker):
                        return self._fetch(unit.future)
                if str(unit.future.key) in self._timed_out:
                    raise UnitTimeoutError(
                        f"it did not end within {self._timeouts.unit:.0f} s on any worker; "
                        "leave out what it is made from, or look at what its workers wait for"
                    )
                if is_alone:
                    raise WorkersDiedError(
                        f"each of the workers that ran it died; it had declared {unit.memory / 1e6:.0f} MB: give workers more "
                        "memory (--workers 1, or dask worker --memory-limit), or leave out the picture it is made from"
                    )
                alone.enter_context(self._suspects)
                is_alone = True
                unit.start()

    def _take(self, ended: SimpleQueue[ClusterUnit[R]]) -> ClusterUnit[R]:
        """Wait for the next unit that ended."""
        while True:
            self._check()
            try:
                return ended.get(timeout=self._timeouts.poll_interval)
            except Empty:
                continue

    def _fetch(self, future: Future[R]) -> R:
        """Fetch a result from the worker that has it; Dask runs the unit again if that worker is lost meanwhile."""
        while True:
            try:
                return future.result(timeout=self._timeouts.silence)
            except CancelledError as error:
                if future.status == "finished":  # another one that was asked for in the same message
                    continue
                raise ClusterGoneError from error
            except OSError as error:
                if future.status == "error":
                    raise
                raise ClusterGoneError from error

    def _check(self) -> None:
        """Raise if the run is over its deadline, or without a scheduler or a worker for too long."""
        if self._until is not None and time.monotonic() > self._until:
            raise RunTimeoutError(RUN_TIMEOUT_MESSAGE)
        with self._polling:
            if time.monotonic() - self._polled >= self._timeouts.poll_interval:
                self._poll()
                self._polled = time.monotonic()

    def _poll(self) -> None:
        if self._client.status != "running":
            raise ClusterGoneError
        try:
            timeout = min(30.0, self._timeouts.silence)
            identity = cast(Any, self._client.scheduler).identity
            answer = self._client.sync(identity, n_workers=-1, callback_timeout=timeout)
        except Exception as error:  # of many kinds, and what matters is whether there is a scheduler still
            log.debug("the scheduler does not answer: %s", error)
            if self._lost_for() > self._timeouts.silence:
                raise ClusterGoneError from error
            return
        self._workers = answer["workers"]
        if self._workers:
            self._lost_since = None
        elif self._lost_for() > self._timeouts.empty:
            raise ClusterGoneError(
                "the Dask scheduler has no worker left; start some (`dask worker ADDRESS`) and run again"
            )

    def _lost_for(self) -> float:
        """Return the seconds since the first poll that found no scheduler or no worker."""
        now = time.monotonic()
        self._lost_since = now if self._lost_since is None else self._lost_since
        return now - self._lost_since

    def _handle_event(self, event: tuple[float, tuple[str, str]]) -> None:
        """Log a line of a worker, with the key of the unit that exceeded its limit there, if any."""
        line, key = event[1]
        log.warning("%s", line)
        self._timed_out.add(key)


def _put(queue: SimpleQueue[ClusterUnit[R]], unit: ClusterUnit[R], future: object) -> None:
    queue.put(unit)
