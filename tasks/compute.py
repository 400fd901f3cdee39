"""Where units run: in this process, on a cluster of local processes, or on any Dask scheduler. Same results on each."""

from __future__ import annotations

import logging
import os
import signal
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, as_completed
from contextlib import contextmanager
from threading import Lock
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from distributed import Client

# Libraries must not spread over the cores that other workers use, nor change sums with the number of threads.
ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")}


class Serial:
    """Runs each unit in the calling thread, one at a time."""

    workers: tuple[str, ...] = ("serial",)

    def __init__(self) -> None:
        self._lock = Lock()

    def submit(self, function: Callable[..., Any], *args: Any, worker: str | None = None) -> Future:
        future: Future = Future()
        with self._lock:
            try:
                future.set_result(function(*args))
            except Exception as error:
                future.set_exception(error)
        return future

    def completed(self, futures: Iterable[Future]) -> Iterator[Future]:
        yield from as_completed(list(futures))


class Cluster:
    """Runs units on the workers of a Dask scheduler."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self.workers = tuple(sorted(client.scheduler_info(n_workers=-1)["workers"]))

    def submit(self, function: Callable[..., Any], *args: Any, worker: str | None = None) -> Any:
        """Start a unit; `worker` is preferred, since it may hold state that another would have to rebuild."""
        if worker is None:
            return self._client.submit(function, *args, pure=False)
        return self._client.submit(function, *args, workers=[worker], allow_other_workers=True, pure=False)

    def completed(self, futures: Iterable[Any]) -> Iterator[Any]:
        from distributed import as_completed as completed

        yield from completed(list(futures))


Compute = Serial | Cluster


@contextmanager
def connect(workers: int, dask: str | None) -> Iterator[Compute]:
    """Compute on the scheduler at address `dask`, else on `workers` local processes; one worker runs in this process."""
    if dask is None and workers <= 1:
        _single_threaded()
        yield Serial()
        return
    import dask as dask_module
    from distributed import Client, LocalCluster

    with dask_module.config.set({"distributed.worker.daemon": True, "distributed.admin.tick.limit": "60s"}):
        if dask is not None:
            with Client(dask, timeout="30s") as client:
                yield Cluster(client)
            return
        for name in ("distributed", "distributed.scheduler", "distributed.nanny", "distributed.core"):
            logging.getLogger(name).setLevel(logging.ERROR)
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
            client.run(_prepare_worker)
            yield Cluster(client)


def _prepare_worker() -> None:
    # Ctrl-C in a terminal reaches every process of its group; workers end with the run, in silence
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _single_threaded()


def _single_threaded() -> None:
    import cv2

    cv2.setNumThreads(1)
