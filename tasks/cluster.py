"""Units on the workers of a Dask scheduler, through the loss of some of them."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, NoReturn

from facade_core.errors import FacadeError
from tasks.workers import run_unit

if TYPE_CHECKING:
    from distributed import Client, Future

# Of the memory that workers have, what units may declare together; the rest is for libraries and a run's plan.
UNITS_SHARE = 0.6
# Memory of a worker that was started without a limit, in bytes.
UNLIMITED = 2**33
# Seconds between two looks at a cluster of which nothing is heard.
LOOK_S = 5.0
# Seconds that a cluster may be without any worker: one that is started anew, by its nanny or by a scaler, needs some.
EMPTY_S = 60.0


class ClusterGone(FacadeError):
    """The scheduler, or its last worker, went away. What was committed stays."""


class WorkersDied(FacadeError):
    """Every worker that ran a unit died of it."""


@dataclass(frozen=True, eq=False)
class _Started:
    """A unit on its way on a cluster, and the bytes it had declared."""

    cluster: Cluster
    future: Future
    memory: int
    again: Callable[[], Future]

    def result(self) -> Any:
        """What the unit returns, or raises.

        Raises WorkersDied when it killed its workers, and did so again with no other suspect beside it; ClusterGone.
        """
        from distributed import KilledWorker

        try:
            return self.cluster.result(self.future)
        except KilledWorker:
            pass  # what waits on a worker that dies is suspected with what ran
        with self.cluster.suspects:
            try:
                return self.cluster.result(self.again())
            except KilledWorker as error:
                raise WorkersDied(
                    f"each of the {error.allowed_failures + 1} workers that ran it died; it had declared "
                    f"{self.memory / 1e6:.0f} MB: give workers more memory (--workers 1, or dask worker --memory-limit), "
                    "or leave out the picture it is made from"
                ) from None


class Cluster:
    """Runs units on the workers of a Dask scheduler.

    memory: bytes that units on all workers may declare together; threads: units that run at once. Both of the workers that
    there are when asked.
    """

    def __init__(self, client: Client) -> None:
        self.suspects = threading.Lock()
        self._client = client
        self._leases: dict[str, tuple[str, int]] = {}  # name -> (address of a worker, bytes)
        self._names = itertools.count(1)
        self._freed = threading.Condition()
        self._seen = time.monotonic()

    @property
    def memory(self) -> int:
        return sum(_share(worker) for worker in self._workers().values())

    @property
    def threads(self) -> int:
        return sum(worker["nthreads"] for worker in self._workers().values())

    def submit(self, function: Callable[..., Any], *args: Any, memory: int = 0, worker: str | None = None) -> _Started:
        """Start a unit that takes `memory` bytes; where `worker` is a lease, preferably where its state is kept."""
        address = None
        if worker is not None:
            address, memory = self._address(worker)

        def start() -> Future:
            from uuid import uuid4

            place = {} if address is None else {"workers": [address], "allow_other_workers": True}
            key = f"{getattr(function, '__name__', 'unit')}-{uuid4()}"
            try:
                return self._client.submit(run_unit, function, *args, key=key, pure=False, **place)
            except Exception as error:
                if self._client.status != "running":
                    _gone(error)
                raise

        return _Started(self, start(), memory, start)

    def completed(self, started: Iterable[_Started]) -> Iterator[_Started]:
        """The units as they complete, those last that died with their worker. A result leaves the cluster with the last
        reference to its unit."""
        from distributed import KilledWorker

        waiting = {unit.future.key: unit for unit in started}
        suspects = []
        ended = _ended(unit.future for unit in waiting.values())
        del started
        while waiting:
            unit = waiting.pop(self._next(ended))
            if unit.future.status == "error" and isinstance(unit.future.exception(), KilledWorker):
                suspects.append(unit)
                continue
            yield unit
            del unit
        yield from suspects

    def result(self, future: Future) -> Any:
        """What a future holds, or raises. Raises ClusterGone rather than to wait for ever."""
        from concurrent.futures import CancelledError

        from distributed.comm import CommClosedError

        if not future.done():
            self._next(_ended([future]))
        try:
            return future.result()
        except (CancelledError, CommClosedError) as error:
            _gone(error)

    def _next(self, ended: SimpleQueue[str]) -> str:
        while True:
            try:
                return ended.get(timeout=LOOK_S)
            except Empty:
                self._workers()

    @contextmanager
    def lease(self, memory: int) -> Iterator[str]:
        """The name of a lease of one thread of a worker, for a sequence of units that share a state of `memory` bytes.

        Waits until a worker has a thread free, and memory for it beside the states it keeps already; a worker that keeps
        none takes one of any size. A lease moves on when its worker is lost.
        """
        name = f"lease {next(self._names)}"
        with self._freed:
            while not (free := self._free(memory)):
                self._freed.wait(timeout=LOOK_S)  # a worker may have joined meanwhile
            self._leases[name] = min(free, key=self._load), memory
        try:
            yield name
        finally:
            with self._freed:
                del self._leases[name]
                self._freed.notify_all()

    def _free(self, memory: int) -> list[str]:
        free = []
        for address, worker in self._workers().items():
            leases, held, _ = self._load(address)
            if leases < worker["nthreads"] and (not leases or held + memory <= _share(worker)):
                free.append(address)
        return free

    def _load(self, address: str) -> tuple[int, int, str]:
        held = [memory for place, memory in self._leases.values() if place == address]
        return len(held), sum(held), address

    def _address(self, name: str) -> tuple[str, int]:
        """Where a lease is now, and its bytes."""
        with self._freed:
            address, memory = self._leases[name]
            workers = self._workers()
            if workers and address not in workers:
                self._leases[name] = min(workers, key=self._load), memory
            return self._leases[name]

    def _workers(self) -> dict[str, Any]:
        """The workers by address. Raises ClusterGone when the scheduler is, or there has been none for EMPTY_S."""
        if self._client.status != "running":
            _gone(None)
        workers = self._client.scheduler_info(n_workers=-1)["workers"]
        if workers:
            self._seen = time.monotonic()
        elif time.monotonic() - self._seen > EMPTY_S:
            raise ClusterGone("the Dask scheduler has no worker left; start some (`dask worker ADDRESS`) and run again")
        return workers


def _ended(futures: Iterable[Future]) -> SimpleQueue[str]:
    """The keys of futures as they end. What waits with a time limit in Dask itself may hold on to futures when that is over."""
    keys: SimpleQueue[str] = SimpleQueue()
    for future in futures:
        future.add_done_callback(lambda ended: keys.put(ended.key))
    return keys


def _share(worker: dict[str, Any]) -> int:
    """What units on a worker may declare; one without a limit says 0."""
    return int((worker["memory_limit"] or UNLIMITED) * UNITS_SHARE)


def _gone(error: BaseException | None) -> NoReturn:
    raise ClusterGone("the Dask cluster went away; run again to go on from here") from error
