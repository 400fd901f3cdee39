"""Where units run: in this process, on a cluster of local processes, or on any Dask scheduler. Same results on each."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from facade_core.errors import InputError
from tasks.cluster import UNITS_SHARE, Cluster
from tasks.workers import ONE_THREAD, limit_threads, prepared, run_unit, standing

if TYPE_CHECKING:
    from distributed import Client

# Seconds in which a scheduler must answer, and in which it must show a worker: those may be on their way.
GREETING_S, ANSWER_S = 10, 30
REMEDY = "start one with `dask scheduler` and `dask worker ADDRESS`, or leave --dask out to use local processes"


@dataclass(frozen=True, eq=False)
class _Later:
    """A unit that runs when its result is asked for."""

    function: Callable[..., Any]
    arguments: tuple
    lock: threading.RLock

    def result(self) -> Any:
        with self.lock:
            return run_unit(self.function, *self.arguments)


class Serial:
    """Runs each unit in this process, one at a time, when its result is asked for."""

    threads = 1

    def __init__(self) -> None:
        import psutil

        self.memory = int(psutil.virtual_memory().available * UNITS_SHARE)
        self._lock = threading.RLock()
        self._leases = threading.Lock()

    def submit(self, function: Callable[..., Any], *args: Any, memory: int = 0, worker: str | None = None) -> _Later:
        return _Later(function, args, self._lock)

    def completed(self, started: Iterable[Any]) -> Iterator[Any]:
        """The units in order. Until the next one is asked for no other starts: each is committed before the one after it."""
        for unit in started:
            with self._lock:
                yield unit

    @contextmanager
    def lease(self, memory: int) -> Iterator[str]:
        """This process, for a sequence of units that share state."""
        with self._leases:
            yield "serial"


Compute = Serial | Cluster


@contextmanager
def connect(workers: int, dask: str | None, folder: str) -> Iterator[Compute]:
    """Compute on the scheduler at address `dask`, else on `workers` local processes; one worker is this process itself.

    `folder` is where units write: every worker must see it. Raises InputError where the scheduler does not answer, has no
    worker, or its workers do not see the folder or have another version of the code.
    """
    if dask is None and workers <= 1:
        limit_threads()
        yield Serial()
        return
    import dask as dask_module
    from distributed import Client, LocalCluster

    # what a unit raises comes back to its task, which says it better
    for name in ("distributed", "distributed.client"):  # Dask gives the second a level of its own
        logging.getLogger(name).setLevel(logging.CRITICAL)
    settings = {
        "distributed.worker.daemon": True,
        "distributed.admin.tick.limit": "60s",
        "distributed.scheduler.allowed-failures": 1,  # a suspect is run once more by itself
        # a local cluster forgets a worker whose nanny takes longer to start it anew than this
        "distributed.deploy.lost-worker-timeout": "1 day",
        # without Dask's MALLOC_TRIM_THRESHOLD_, which has every array of a viewpoint mapped anew: a tenth of its time
        "distributed.nanny.pre-spawn-environ": ONE_THREAD,
        # what watches the workers, 50 to 100 times a second each, takes an eighth of a core from them
        "distributed.worker.profile.enabled": False,
        "distributed.admin.tick.interval": "1s",
        "distributed.admin.system-monitor.interval": "5s",
    }
    with dask_module.config.set(settings):
        if dask is not None:
            with _client(dask) as client:
                _check_workers(client, dask, folder)
                yield Cluster(client)
            return
        with (
            LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,
            ) as cluster,
            Client(cluster) as client,
        ):
            client.register_plugin(prepared(ours=True), name="streetloom")
            yield Cluster(client)


def require_scheduler(address: str) -> None:
    """Raise InputError at once where nothing listens, within GREETING_S where something else does: a client that finds no
    scheduler is long in ending."""
    import asyncio
    import socket

    from distributed.comm import connect as greet
    from distributed.comm.addressing import parse_address, parse_host_port

    async def hello() -> None:
        (await asyncio.wait_for(greet(address), GREETING_S)).abort()

    try:
        scheme, place = parse_address(address)
        if scheme not in ("tcp", "tls"):
            raise ValueError(f"not a Dask address: {address!r}")
        socket.create_connection(parse_host_port(place), timeout=GREETING_S).close()
        asyncio.run(hello())
    except Exception as error:  # what does not speak Dask is met with errors of every kind
        raise InputError(f"--dask {address}: no scheduler answers there; {REMEDY}") from error


@contextmanager
def _client(address: str) -> Iterator[Client]:
    from distributed import Client

    require_scheduler(address)
    with Client(address, timeout=ANSWER_S) as client:
        try:
            client.wait_for_workers(1, timeout=ANSWER_S)
        except (TimeoutError, OSError) as error:
            raise InputError(f"--dask {address}: the scheduler has no worker; {REMEDY}") from error
        yield client


def _check_workers(client: Client, address: str, folder: str) -> None:
    import tempfile

    from tasks.run import code_version

    try:
        client.register_plugin(prepared(ours=False), name="streetloom")
        with tempfile.NamedTemporaryFile(
            dir=folder, prefix=".seen-"
        ) as token:  # elsewhere a folder may have the same name
            answers = client.run(standing, token.name)
    except Exception as error:  # whatever a worker of another make answers with
        raise InputError(
            f"--dask {address}: its workers cannot run this version ({error}); start them in the same environment"
        ) from error
    for worker, (sees, version) in sorted(answers.items()):
        if not sees:
            raise InputError(
                f"--dask {address}: worker {worker} does not see {folder}, or cannot write there; "
                "name a folder with --out that all workers share"
            )
        if version != code_version():
            raise InputError(
                f"--dask {address}: worker {worker} has version {version} and this is {code_version()}; "
                "start them in the same environment"
            )
