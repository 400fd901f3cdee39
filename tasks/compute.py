"""Where units run: in this process, on a cluster of local processes, or on any Dask scheduler. Same results on each."""

from __future__ import annotations

import logging
import os
import signal
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Condition, Lock
from typing import TYPE_CHECKING, Any

from facade_core.errors import InputError

if TYPE_CHECKING:
    from distributed import Client

# Libraries must not spread over the cores that other workers use, nor change sums with the number of threads.
ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")}
# Of the memory that workers have, what units may declare together; the rest is for libraries and a run's plan.
UNITS_SHARE = 0.6
# Seconds in which a scheduler must answer and show a worker.
ANSWER_S = 30


@dataclass
class _Later:
    """A unit that runs when its result is asked for: so its work is committed before the next one starts."""

    function: Callable[..., Any]
    arguments: tuple
    lock: Lock

    def result(self) -> Any:
        with self.lock:
            return self.function(*self.arguments)


class Serial:
    """Runs each unit in this process, one at a time, when its result is asked for."""

    threads = 1

    def __init__(self) -> None:
        import psutil

        self.memory = int(psutil.virtual_memory().available * UNITS_SHARE)
        self._lock = Lock()
        self._streets = Lock()

    def submit(self, function: Callable[..., Any], *args: Any, worker: str | None = None) -> _Later:
        return _Later(function, args, self._lock)

    def completed(self, futures: Iterable[Any]) -> Iterator[Any]:
        yield from futures

    @contextmanager
    def lease(self, memory: int) -> Iterator[str]:
        """This process, for a sequence of units that share state."""
        with self._streets:
            yield "serial"


class Cluster:
    """Runs units on the workers of a Dask scheduler.

    memory: bytes that units on all workers may declare together; threads: units that run at once.
    """

    def __init__(self, client: Client) -> None:
        self._client = client
        self._leased: Counter[str] = Counter()
        self._freed = Condition()
        self._held = 0
        workers = self._workers()
        # a worker without a limit says 0: it may take what its machine has
        self.memory = int(sum(w["memory_limit"] or 2**33 for w in workers.values()) * UNITS_SHARE)
        self.threads = sum(w["nthreads"] for w in workers.values())

    def _workers(self) -> dict[str, Any]:
        return self._client.scheduler_info(n_workers=-1)["workers"]

    def submit(self, function: Callable[..., Any], *args: Any, worker: str | None = None) -> Any:
        """Start a unit; `worker` is preferred, since it may hold state that another would have to rebuild."""
        if worker is None:
            return self._client.submit(function, *args, pure=False)
        return self._client.submit(function, *args, workers=[worker], allow_other_workers=True, pure=False)

    def completed(self, futures: Iterable[Any]) -> Iterator[Any]:
        """The futures as they complete. A result leaves the cluster with the last reference to its future."""
        from distributed import as_completed

        yield from as_completed(list(futures))

    @contextmanager
    def lease(self, memory: int) -> Iterator[str]:
        """The address of a worker for a sequence of units that share a state of `memory` bytes.

        Waits until a worker has a thread free, and until the states on all workers fit their memory; one is always let in.
        """
        with self._freed:
            while not (free := self._free(memory)):
                self._freed.wait(timeout=5)  # a worker may have joined meanwhile
            worker = min(free, key=lambda address: (self._leased[address], address))
            self._leased[worker] += 1
            self._held += memory
        try:
            yield worker
        finally:
            with self._freed:
                self._leased[worker] -= 1
                self._held -= memory
                self._freed.notify_all()

    def _free(self, memory: int) -> list[str]:
        if self._held and self._held + memory > self.memory:
            return []
        return [address for address, worker in self._workers().items() if self._leased[address] < worker["nthreads"]]


Compute = Serial | Cluster


def lost(error: BaseException) -> bool:
    """Whether an error says that the cluster is gone, not that a unit failed."""
    from concurrent.futures import CancelledError

    from distributed.comm import CommClosedError

    return isinstance(error, CancelledError | CommClosedError)


@contextmanager
def connect(workers: int, dask: str | None, folder: str) -> Iterator[Compute]:
    """Compute on the scheduler at address `dask`, else on `workers` local processes; one worker is this process itself.

    `folder` is where units write: every worker must see it. Raises InputError where the scheduler does not answer, has no
    worker, or its workers do not see the folder.
    """
    if dask is None and workers <= 1:
        _single_threaded()
        yield Serial()
        return
    import dask as dask_module
    from distributed import Client, LocalCluster

    with dask_module.config.set({"distributed.worker.daemon": True, "distributed.admin.tick.limit": "60s"}):
        for name in ("distributed", "distributed.scheduler", "distributed.nanny", "distributed.core"):
            logging.getLogger(name).setLevel(logging.ERROR)
        if dask is not None:
            with _client(dask) as client:
                _check_workers(client, dask, folder)
                yield Cluster(client)
            return
        os.environ.update({k: v for k, v in ONE_THREAD.items() if k not in os.environ})
        with (
            LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,  # what a unit raises comes back to its task, which says it better
            ) as cluster,
            Client(cluster) as client,
        ):
            client.run(_ignore_interrupts)
            client.register_plugin(_prepared(), name="streetloom")
            yield Cluster(client)


@contextmanager
def _client(address: str) -> Iterator[Client]:
    from distributed import Client

    remedy = "start one with `dask scheduler` and `dask worker ADDRESS`, or leave --dask out to use local processes"
    try:
        client = Client(address, timeout=ANSWER_S)
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f"--dask {address}: no scheduler answers there; {remedy}") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=ANSWER_S)
        except TimeoutError as error:
            raise InputError(f"--dask {address}: the scheduler has no worker; {remedy}") from error
        yield client


def _check_workers(client: Client, address: str, folder: str) -> None:
    try:
        seen = client.run(os.path.isdir, folder)
        client.register_plugin(_prepared(), name="streetloom")
    except Exception as error:  # whatever a worker of another make answers with
        raise InputError(
            f"--dask {address}: its workers cannot run this version ({error}); start them in the same environment"
        ) from error
    if blind := sorted(worker for worker, there in seen.items() if not there):
        raise InputError(
            f"--dask {address}: worker {blind[0]} does not see {folder}; name a folder with --out that all workers share"
        )


def _prepared() -> Any:
    """A plugin that prepares every worker, those that join later too."""
    from distributed import WorkerPlugin

    class SingleThreaded(WorkerPlugin):
        def setup(self, worker: Any) -> None:
            _single_threaded()

    return SingleThreaded()


def _ignore_interrupts() -> None:
    # Ctrl-C in a terminal reaches every process of its group; workers end with the run, in silence
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _single_threaded() -> None:
    import cv2
    import scipy.linalg  # noqa: F401 the limit holds for libraries that are loaded
    from threadpoolctl import threadpool_limits

    cv2.setNumThreads(1)
    threadpool_limits(1)
