"""Execution of units on the workers of a Dask scheduler, with recovery from lost workers.

A watcher polls the scheduler. Units of a worker that is gone or silent are submitted again under a new key. A unit that
exceeds the deadline of its stage is tried on another worker too. The first copy that ends counts; results of the others are
never fetched.
"""

from __future__ import annotations

import itertools
import logging
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future as Answer
from concurrent.futures import as_completed
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, TypeVar, cast
from uuid import uuid4

from facade_core.core.errors import FacadeError, MachineError
from tasks.engine.compute.attempts import ClusterUnit, SubmittedUnit, UnitSubmission, fetch_result
from tasks.engine.compute.deadlines import Deadlines
from tasks.engine.compute.leases import ForgetCall, WorkerLease, WorkerLeases
from tasks.engine.compute.scheduler_view import (
    SchedulerView,
    WorkerRegistry,
    WorkerState,
    poll_scheduler,
    restart_workers,
)
from tasks.engine.compute.timeouts import DEFAULT_TIMEOUTS, Timeouts
from tasks.engine.compute.worker_setup import run_timed_unit

if TYPE_CHECKING:
    from distributed import Client, Future

R = TypeVar("R")

# Workers that may go away under a unit until it is suspected.
MAX_WORKER_DEATHS = 1

OVERRUN_MESSAGE = "the run took longer than its deadline; run again to go on from here"
START_WORKERS = "start some (`dask worker ADDRESS`) and run again"

log = logging.getLogger(__name__)


# Asks a scheduler for its view of the workers: the client, and the seconds within which it is to answer.
Look = Callable[["Client", float], SchedulerView]


class ClusterGoneError(MachineError):
    """The scheduler, or its last worker, is gone. Committed units stay."""


class WorkersDiedError(FacadeError):
    """Every worker that ran a unit died."""


class UnitTimeoutError(FacadeError):
    """A unit did not end in time on any worker."""


class RunTimeoutError(MachineError):
    """A run did not end in time. Committed units stay."""


class Cluster:
    """Runs units on the workers of a Dask scheduler, until a deadline by time.monotonic() if there is one.

    Attributes
    ----------
    memory : bytes that units on all workers may declare together, by the last poll.
    threads : units that run at once, by the last poll.
    """

    def __init__(
        self,
        client: Client,
        until: float | None = None,
        *,
        poll: Look = poll_scheduler,
        timeouts: Timeouts = DEFAULT_TIMEOUTS,
    ) -> None:
        self._client, self._until = client, until
        self._look, self._timeouts = poll, timeouts
        self._changed = threading.Condition()  # holds for all that follows
        self._registry = WorkerRegistry(poll(client, timeouts.answer), timeouts)
        self._units: set[ClusterUnit[object]] = set()
        self._leases, self._names = WorkerLeases(), itertools.count(1)
        self._forget_calls: list[Future[tuple[float, object]]] = []
        self._over: FacadeError | None = None
        self._suspects = threading.Lock()
        self._deadlines = Deadlines(timeouts)
        self._closed = threading.Event()
        self._watcher = threading.Thread(target=self._watch, name="watch the cluster", daemon=True)
        self._watcher.start()

    def close(self) -> None:
        """Stop polling."""
        self._closed.set()
        self._watcher.join(self._timeouts.poll_interval)  # a scheduler that is gone may be long in not answering

    @property
    def memory(self) -> int:
        """Return the bytes that units on all workers may declare together."""
        with self._changed:
            return sum(worker.share for worker in self._registry.usable.values())

    @property
    def threads(self) -> int:
        """Return the number of units that run at once."""
        with self._changed:
            return sum(worker.threads for worker in self._registry.usable.values())

    def submit(
        self, function: Callable[..., R], *args: object, memory: int = 0, worker: str | None = None
    ) -> ClusterUnit[R]:
        """Submit a unit that takes `memory` bytes; if `worker` is a lease, to the worker that keeps its state."""
        with self._changed:
            unit = ClusterUnit(self, (function, *args), self._leases[worker].memory if worker else memory, worker)
            self._begin(unit)
        return unit

    def iterate_completed(self, started: Iterable[SubmittedUnit[R]]) -> Iterator[SubmittedUnit[R]]:
        """Iterate over units as they complete, those whose workers died last.

        A result leaves the cluster with the last reference to its unit.
        """
        # a cluster submits no other units than attempts
        waiting = {unit.answer: unit for unit in cast(Iterable[ClusterUnit[R]], started)}
        suspects = []
        del started
        for answer in as_completed(list(waiting)):
            unit = waiting.pop(answer)
            suspected = answer.exception() is None and answer.result() is None
            del answer
            if suspected:
                suspects.append(unit)
                continue
            yield unit
            del unit
        yield from suspects

    def result(self, unit: ClusterUnit[R]) -> R:
        """Wait for the result of a unit; submit the unit again if its workers died."""
        with ExitStack() as alone:
            while True:
                future = unit.answer.result()
                if future is not None and (ran := fetch_result(future)) is not None:
                    seconds, result = ran
                    self._deadlines.record(unit.stage, seconds)
                    return result
                if future is None and unit.alone:
                    raise WorkersDiedError(
                        f"each of the workers that ran it died; it had declared {unit.memory / 1e6:.0f} MB: give workers more "
                        "memory (--workers 1, or dask worker --memory-limit), or leave out the picture it is made from"
                    )
                if future is None:  # what waits on a worker that dies is suspected with what ran
                    alone.enter_context(self._suspects)
                    unit.alone = True
                unit.answer = Answer()
                with self._changed:
                    self._begin(unit)

    @contextmanager
    def lease(self, memory: int, forget: ForgetCall | None = None) -> Iterator[str]:
        """Lease one thread of a worker for a sequence of units that share a state of `memory` bytes; yields the lease's name.

        Waits for a free thread and free memory; a worker without a state takes one of any size. A lease whose
        worker is lost waits
        for room elsewhere.

        Parameters
        ----------
        forget : function with its arguments that is called on every worker that the lease leaves.
        """
        name, lease = f"lease {next(self._names)}", WorkerLease("", memory, forget)
        with self._changed:
            self._check()
            while not self._leases.take(name, lease, self._registry.usable):
                self._changed.wait(timeout=self._timeouts.poll_interval)
                self._check()
        try:
            yield name
        finally:
            with self._changed:
                self._units = {unit for unit in self._units if unit.lease != name}
                self._forget(self._leases.end(name))
                self._changed.notify_all()

    # What follows is called with self._changed held.

    def _check(self) -> None:
        if self._over is not None:
            raise type(self._over)(*self._over.args)

    def _begin(self, unit: ClusterUnit[object]) -> None:
        self._check()
        unit.deaths = 0
        self._units.add(unit)
        self._place(unit)

    def _place(self, unit: ClusterUnit[object]) -> bool:
        """Submit a unit to Dask; False if no worker has room until a later poll."""
        usable = self._registry.usable
        places = None if len(usable) == len(self._registry.view.workers) else frozenset(usable)
        if unit.lease is not None:
            lease = self._leases[unit.lease]
            if lease.address not in usable and not self._move_lease(unit.lease, lease, usable):
                return False
            places = frozenset([lease.address])
        if not usable:
            return False
        future = self._submit_call(unit.call, places, unit.stage)
        if future is None:
            return False
        unit.copies[str(future.key)] = UnitSubmission(future, places)
        future.add_done_callback(lambda ended: self._finish_copy(unit, ended))
        return True

    def _submit_call(
        self, call: ForgetCall, places: frozenset[str] | None, name: str
    ) -> Future[tuple[float, object]] | None:
        place = {} if places is None else {"workers": sorted(places)}
        try:
            return self._client.submit(run_timed_unit, *call, key=f"{name}-{uuid4()}", pure=False, **place)
        except Exception as error:
            if self._client.status == "running":
                raise
            self._end(cluster_gone_error(), error)
            return None

    def _move_lease(self, name: str, lease: WorkerLease, usable: dict[str, WorkerState]) -> bool:
        left = WorkerLease(lease.address, lease.memory, lease.forget)
        moved = self._leases.move(name, usable)
        if moved:
            self._forget(left)
        return moved

    def _forget(self, lease: WorkerLease) -> None:
        """Remove the state of a lease from its worker, now or when that worker wakes."""
        self._forget_calls = [future for future in self._forget_calls if not future.done()]
        if lease.forget and lease.address in self._registry.view.workers and self._over is None:
            future = self._submit_call(lease.forget, frozenset([lease.address]), "forget")
            self._forget_calls += [future] if future is not None else []

    def _settle(
        self,
        unit: ClusterUnit[object],
        answer: Future[tuple[float, object]] | None = None,
        error: FacadeError | None = None,
    ) -> None:
        """Set the answer of a unit and cancel its other copies; workers that run an overdue copy are restarted."""
        self._units.discard(unit)
        others, unit.copies = list(unit.copies.values()), {}
        if error is not None:
            unit.answer.set_exception(error)
        else:
            unit.answer.set_result(answer)
        for copy in others:
            copy.future.cancel()
        stuck = {copy.address for copy in others if copy.overdue} & self._registry.view.workers.keys()
        if workers := {address: self._registry.view.workers[address] for address in stuck if address}:
            threading.Thread(target=restart_workers, args=(self._client, workers), daemon=True).start()

    def _end(self, error: FacadeError, cause: BaseException | None = None) -> None:
        """End the run: all waiting and later callers receive the error."""
        if self._over is None:
            error.__cause__ = cause
            self._over = error
            for unit in list(self._units):
                self._units.discard(unit)
                unit.answer.set_exception(type(error)(*error.args))
            self._changed.notify_all()

    def _finish_copy(self, unit: ClusterUnit[object], future: Future[tuple[float, object]]) -> None:
        """Handle the end of a copy; called by Dask in a thread of its own, without locks."""
        from distributed import KilledWorker

        status = future.status
        killed = status == "error" and isinstance(future.exception(), KilledWorker)
        with self._changed:
            copy = unit.copies.pop(str(future.key), None)
            if copy is None or unit not in self._units:  # another was first
                return
            if killed and not unit.copies:
                self._settle(unit)
            elif status in ("finished", "error") and not killed:
                self._registry.stuck.discard(copy.address or "")
                self._settle(unit, future)
            # else: its key was lost with its worker or the scheduler; the watcher sees which

    def _watch(self) -> None:
        last = answered = time.monotonic()
        while not self._closed.wait(self._timeouts.poll_interval):
            view = None
            try:
                view = self._look(self._client, self._timeouts.answer)
                answered = time.monotonic()
            except Exception as error:  # of many kinds, and what matters is whether there is a scheduler still
                log.debug("the scheduler does not answer: %s", error)
            if self._closed.is_set():
                return
            now = time.monotonic()
            # what this process slept through is nobody's delay
            awake, last = min(now - last, 2 * self._timeouts.poll_interval), now
            with self._changed:
                try:
                    if self._client.status != "running" or now - answered > self._timeouts.silence:
                        self._end(cluster_gone_error())
                    elif self._until is not None and now > self._until:
                        self._end(RunTimeoutError(OVERRUN_MESSAGE))
                    elif view is not None:
                        self._update(view, awake)
                except Exception:
                    log.exception("the watcher of the cluster failed")
                    self._end(ClusterGoneError("the cluster cannot be watched; the log says why; run again"))
                self._changed.notify_all()

    def _update(self, view: SchedulerView, awake: float) -> None:
        self._registry.update(view, awake)
        if self._registry.empty > self._timeouts.empty:
            self._end(ClusterGoneError(f"the Dask scheduler has no worker left; {START_WORKERS}"))
        for unit in list(self._units):  # no name of the watcher itself: a unit keeps its result on the cluster
            self._reconsider(unit, awake)

    def _reconsider(self, unit: ClusterUnit[object], awake: float) -> None:
        """Submit a unit again if its workers are gone or silent; try it elsewhere too if it is overdue."""
        usable = self._registry.usable
        limit = self._deadlines.limit(unit.stage)
        for key, copy in list(unit.copies.items()):
            copy.address = self._registry.view.assigned.get(key, copy.address)
            places = (
                frozenset([self._registry.view.assigned[key]])
                if key in self._registry.view.assigned
                else copy.allowed_workers
            )
            if places is not None and not places & self._registry.view.workers.keys():
                del unit.copies[key]
                copy.future.cancel()
                unit.deaths += 1
            elif places is not None and not places & usable.keys() and not copy.overdue and self._place(unit):
                del unit.copies[key]  # it may have its turn when its worker wakes, and nobody will ask for it
                copy.future.cancel()
            elif key in self._registry.view.executing and copy.address in self._registry.view.workers:
                copy.running_seconds += awake if copy.overdue or copy.address in usable else 0.0
                if copy.running_seconds >= limit and not copy.overdue:
                    copy.overdue = True
                    self._registry.stuck.add(copy.address)
        if unit.deaths > MAX_WORKER_DEATHS and not unit.copies:
            self._settle(unit)
        elif not unit.copies:
            self._place(unit)
        elif all(copy.overdue for copy in unit.copies.values()):
            self._handle_overdue(unit, limit)

    def _handle_overdue(self, unit: ClusterUnit[object], limit: float) -> None:
        longest = max(copy.running_seconds for copy in unit.copies.values())
        if len(unit.copies) == 1 and longest < 2 * limit:
            if self._place(unit):
                log.warning("%s takes longer than %.0f s; it is tried on another worker too", unit.stage, limit)
            return
        said = f"it did not end within {longest:.0f} s, where {limit:.0f} are given to each of its kind"
        self._settle(
            unit,
            error=UnitTimeoutError(f"{said}; leave out what it is made from, or look at what its workers wait for"),
        )


def cluster_gone_error() -> ClusterGoneError:
    """Build the error for a cluster that went away."""
    return ClusterGoneError("the Dask cluster went away; run again to go on from here")
