"""Connections to compute: this process, local processes, or a Dask scheduler. Results are the same on each."""

from __future__ import annotations

import logging
import os
import signal
import threading
import time
import uuid
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from queue import Empty, Queue
from typing import TYPE_CHECKING, Generic, TypeVar

from catalogs.published.s3 import folder_at
from facade_core.core.errors import InputError, MachineError
from tasks.engine.compute.attempts import SubmittedUnit
from tasks.engine.compute.cluster import OVERRUN_MESSAGE, Cluster, ClusterGoneError, RunTimeoutError
from tasks.engine.compute.leases import ForgetCall
from tasks.engine.compute.scheduler_view import UNITS_SHARE
from tasks.engine.compute.timeouts import DEFAULT_TIMEOUTS, Timeouts
from tasks.engine.compute.worker_setup import (
    LOG_TOPIC,
    ONE_THREAD,
    diff_environment,
    environment_versions,
    inspect_worker,
    limit_threads,
    run_unit,
    worker_plugin_remover,
    worker_setup_plugin,
)

if TYPE_CHECKING:
    from distributed import Client, LocalCluster

log = logging.getLogger(__name__)

R = TypeVar("R")
R_co = TypeVar("R_co", covariant=True)

# Where Dask reads what TLS needs.
TLS = "DASK_DISTRIBUTED__COMM__TLS__CA_FILE, ..__TLS__CLIENT__CERT and ..__TLS__CLIENT__KEY"
# Settings of Dask in a process that starts workers or connects to them.
_DASK_SETTINGS = {
    "distributed.worker.daemon": True,
    "distributed.admin.tick.limit": "60s",
    "distributed.admin.large-graph-warning-threshold": "1 GiB",  # runs of rays take the block's geometry along
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
START_SCHEDULER = (
    "start one with `dask scheduler` and `dask worker ADDRESS`, or leave --dask out to use local processes"
)


@dataclass(frozen=True, eq=False)
class DeferredUnit(Generic[R_co]):
    """A unit that runs when its result is asked for."""

    function: Callable[..., R_co]
    arguments: tuple[object, ...]
    serial: SerialCompute

    def result(self) -> R_co:
        """Run the unit in this process and return its result."""
        with self.serial.lock:
            self.serial.require_open()
            return run_unit(self.function, *self.arguments)


class SerialCompute:
    """Runs each unit in this process, one at a time, when its result is requested."""

    threads = 1

    def __init__(self, until: float | None = None) -> None:
        import psutil

        self._until = until
        self.memory = int(psutil.virtual_memory().available * UNITS_SHARE)
        self.lock = threading.RLock()
        self._leases = threading.Lock()
        self._open = True

    def submit(
        self, function: Callable[..., R], *args: object, memory: int = 0, worker: str | None = None
    ) -> DeferredUnit[R]:
        """Defer a unit until its result is requested; `memory` and `worker` have no effect."""
        if self._until is not None and time.monotonic() > self._until:
            raise RunTimeoutError(OVERRUN_MESSAGE)
        return DeferredUnit(function, args, self)

    def iterate_completed(self, started: Iterable[SubmittedUnit[R]]) -> Iterator[SubmittedUnit[R]]:
        """Iterate over the units in order.

        No other starts until the next is requested: each is committed before the next one.
        """
        for unit in started:
            with self.lock:
                yield unit

    @contextmanager
    def lease(self, memory: int, forget: ForgetCall | None = None) -> Iterator[str]:
        """Lease this process for a sequence of units that share state; `forget`, a function with its arguments, releases it."""
        with self._leases:
            self.require_open()
            try:
                yield "serial"
            finally:
                if forget:
                    run_unit(*forget)

    def close(self) -> None:
        """Start no more units: the run ends, and its threads may still wait for their turn."""
        self._open = False

    def require_open(self) -> None:
        """Raise MachineError if the run has ended."""
        if not self._open:
            raise MachineError("the run has ended")


Compute = SerialCompute | Cluster


@contextmanager
def connect(
    workers: int,
    dask: str | None,
    folder: str,
    until: float | None = None,
    *,
    timeouts: Timeouts = DEFAULT_TIMEOUTS,
    versions: Callable[[], dict[str, str]] = environment_versions,
) -> Iterator[Compute]:
    """Connect to the scheduler at address `dask`, else to `workers` local processes; one worker is this process itself.

    Parameters
    ----------
    folder : folder that units write to; every worker must see it.
    until : deadline by time.monotonic(); running units then end with RunOverran, in this process at the end of the unit.
    timeouts : limits for the scheduler, its workers and units.
    versions : returns the environment of this process, which workers must share.

    Raises
    ------
    InputError : the scheduler does not answer, no worker has this version, or a worker of this version does not see the folder.
    """
    if dask is None and workers <= 1:
        limit_threads()
        serial = SerialCompute(until)
        try:
            yield serial
        finally:
            serial.close()
        return
    import dask as dask_module
    from distributed import Client

    # what a unit raises comes back to its task, which says it better
    for name in ("distributed", "distributed.client"):  # Dask gives the second a level of its own
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with dask_module.config.set(_DASK_SETTINGS):
        if dask is not None:
            with _connect_client(dask, timeouts) as client:
                _check_workers(client, dask, folder, versions())
                with _cluster_context(client, until, timeouts) as compute:
                    yield compute
            return
        with _start_local_cluster(workers) as cluster, Client(cluster) as client:
            client.register_plugin(worker_setup_plugin(), name="streetloom")
            with _cluster_context(client, until, timeouts) as compute:
                yield compute


@contextmanager
def start_shared_workers(workers: int) -> Iterator[str]:
    """Start local processes for several runs at once; yields the address of their scheduler.

    Raises
    ------
    ClusterGoneError : they do not start.
    """
    import dask as dask_module
    from distributed import Client

    with (
        dask_module.config.set(_DASK_SETTINGS),
        _start_local_cluster(workers) as cluster,
        Client(cluster) as client,
    ):
        client.register_plugin(worker_setup_plugin(), name="streetloom")
        yield cluster.scheduler_address


@contextmanager
def _cluster_context(client: Client, until: float | None, patience: Timeouts) -> Iterator[Cluster]:
    cluster = Cluster(client, until, timeouts=patience)
    try:
        yield cluster
    finally:
        cluster.close()


def _track_quietly() -> None:
    """Start Python's resource tracker without its warning on semaphores, which Ctrl-C would print."""
    from multiprocessing import resource_tracker

    stated = os.environ.get("PYTHONWARNINGS")
    quiet = "ignore:resource_tracker:UserWarning"
    os.environ["PYTHONWARNINGS"] = f"{stated},{quiet}" if stated else quiet
    try:
        resource_tracker.ensure_running()
    finally:
        if stated is None:
            del os.environ["PYTHONWARNINGS"]
        else:
            os.environ["PYTHONWARNINGS"] = stated


@contextmanager
def _block_interrupts() -> Iterator[None]:
    """Block SIGINT in threads started meanwhile, and so in their processes, from the first instruction on.

    Ctrl-C in a terminal reaches every process of its group. Workers end with the run, in silence; one that still imports
    its modules would print where it was.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _start_local_cluster(workers: int) -> LocalCluster:
    """Start local processes; tries again once if one dies. Raises ClusterGone."""
    from distributed import LocalCluster

    _track_quietly()
    cause: Exception | None = None
    for _ in range(2):
        try:
            with _block_interrupts():
                return LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    host="127.0.0.1",
                    dashboard_address="127.0.0.1:0",
                    silence_logs=logging.CRITICAL,
                )
        except Exception as error:
            log.warning("local workers do not start: %s", error)
            cause = error
    raise ClusterGoneError(
        f"{workers} local workers do not start; see to the machine's memory, or name fewer with --workers"
    ) from cause


def require_scheduler(address: str, within: float = DEFAULT_TIMEOUTS.connect) -> None:
    """Check that a scheduler listens, within so many seconds; a Dask client takes long to find that there is none.

    Raises
    ------
    InputError : none answers.
    """
    from distributed.security import Security

    arguments = Security().get_connection_args("client")
    if address.startswith("tls:") and not arguments.get("ssl_context"):
        raise InputError(f"--dask {address}: a certificate is needed; name its files by {TLS}")
    answer: Queue[Exception | None] = Queue()
    threading.Thread(target=_greet, args=(address, arguments, answer, within), daemon=True).start()
    try:
        error: Exception | None = answer.get(timeout=within)
    except Empty:
        error = TimeoutError(f"no answer in {within:g} s")
    if error is not None:
        raise InputError(f"--dask {address}: no scheduler answers there; {START_SCHEDULER}") from error


def _greet(address: str, arguments: dict[str, object], answer: Queue[Exception | None], within: float) -> None:
    import asyncio
    import socket

    from distributed.comm.addressing import parse_address, parse_host_port
    from distributed.comm.core import connect as greet

    async def hello() -> None:
        (await greet(address, **arguments)).abort()

    try:
        scheme, place = parse_address(address)
        if scheme not in ("tcp", "tls"):
            raise ValueError(f"not a Dask address: {address!r}")
        socket.create_connection(parse_host_port(place), timeout=within).close()
        asyncio.run(hello())
        answer.put(None)
    except Exception as error:  # what does not speak Dask is met with errors of every kind
        answer.put(error)


@contextmanager
def _connect_client(address: str, patience: Timeouts) -> Iterator[Client]:
    from distributed import Client

    require_scheduler(address, patience.connect)
    with Client(address, timeout=patience.first_worker) as client:
        try:
            client.wait_for_workers(1, timeout=patience.first_worker)
        except (TimeoutError, OSError) as error:
            raise InputError(f"--dask {address}: the scheduler has no worker; {START_SCHEDULER}") from error
        yield client


def _check_workers(client: Client, address: str, folder: str, wanted: dict[str, str]) -> None:
    """Check that workers share the environment `wanted` and see the folder."""
    from distributed.comm.core import CommClosedError

    try:
        # elsewhere a folder may have the same name
        token = folder_at(folder) / f".seen-{uuid.uuid4().hex}"
        token.touch()
        try:
            answers = client.run(inspect_worker, str(token))
        finally:
            token.unlink(missing_ok=True)
    except CommClosedError as error:  # the scheduler went away meanwhile
        raise InputError(f"--dask {address}: no scheduler answers there any more; {START_SCHEDULER}") from error
    except Exception as error:  # whatever a worker of another make answers with
        lacking = f"they lack {error.name}" if isinstance(error, ModuleNotFoundError) else "theirs is another"
        raise InputError(
            f"--dask {address}: its workers cannot run this version ({lacking}); start them in the same environment"
        ) from error
    others = {
        worker: said for worker, (_, theirs) in sorted(answers.items()) if (said := diff_environment(wanted, theirs))
    }
    if len(others) == len(answers):
        worker, said = next(iter(others.items()))
        raise InputError(f"--dask {address}: worker {worker} {said}; start them in the same environment")
    for worker, (sees, _) in sorted(answers.items()):
        if not sees and worker not in others:
            raise InputError(
                f"--dask {address}: worker {worker} does not see {folder}, or cannot write there; "
                "name a folder with --out that all workers share, or a bucket that their environment leads to"
            )
    client.subscribe_topic(LOG_TOPIC, lambda event: log.warning("%s", event[1]))
    name = f"streetloom {client.id}"  # of this run alone: another one on the same scheduler has its own
    client.register_plugin(worker_plugin_remover(client.id, name), name=name)
    client.register_plugin(worker_setup_plugin(wanted), name=name)
