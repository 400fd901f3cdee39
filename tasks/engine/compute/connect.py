"""Connections to compute: this process, local processes, or a Dask scheduler. Results are the same on each."""

from __future__ import annotations

import logging
import os
import signal
import socket
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from catalogs.published.s3 import folder_at
from facade_core.core.errors import InputError
from tasks.engine.compute.cluster import DEFAULT_TIMEOUTS, Cluster, ClusterGoneError, Timeouts
from tasks.engine.compute.serial import SerialCompute
from tasks.engine.compute.worker_setup import (
    ONE_THREAD,
    diff_environment,
    environment_versions,
    inspect_worker,
    limit_threads,
    worker_plugin_remover,
    worker_setup_plugin,
)

if TYPE_CHECKING:
    from distributed import Client, LocalCluster, WorkerPlugin

log = logging.getLogger(__name__)

# Where Dask reads what TLS needs.
_TLS = "DASK_DISTRIBUTED__COMM__TLS__"
CERTIFICATE_VARIABLES = (f"{_TLS}CA_FILE", f"{_TLS}CLIENT__CERT", f"{_TLS}CLIENT__KEY")
# Settings of Dask in a process that starts workers or connects to them.
_DASK_SETTINGS = {
    "distributed.worker.daemon": True,
    "distributed.admin.tick.limit": "60s",
    "distributed.admin.large-graph-warning-threshold": "1 GiB",  # runs of rays take the block's geometry along
    "distributed.scheduler.allowed-failures": 1,  # a suspect is run once more by itself
    "distributed.scheduler.worker-ttl": "60s",  # a worker without a heartbeat is restarted within twice that time
    # a local cluster forgets a worker whose nanny takes longer to start it anew than this
    "distributed.deploy.lost-worker-timeout": "1 day",
    # without Dask's MALLOC_TRIM_THRESHOLD_, which has every array of a viewpoint mapped anew: a tenth of its time
    "distributed.nanny.pre-spawn-environ": ONE_THREAD,
    # what watches the workers, 10 to 100 times a second each, takes an eighth of a core from them
    "distributed.worker.profile.enabled": False,
    "distributed.worker.memory.monitor-interval": "500ms",
    "distributed.scheduler.work-stealing-interval": "500ms",
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
}
# How often workers are set up if some die meanwhile.
PLUGIN_TRIES = 5
START_SCHEDULER = (
    "start one with `dask scheduler` and `dask worker ADDRESS`, or leave --dask out to use local processes"
)


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
    until : deadline by time.monotonic(); units then raise RunTimeoutError, in this process those that have not begun.
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
    import distributed

    # what a unit raises comes back to its task, which says it better
    for name in (distributed.__name__, distributed.client.__name__):  # which their import has given levels
        logging.getLogger(name).setLevel(logging.CRITICAL)
    if dask is None:
        with _start_local_client(workers) as client:
            yield Cluster(client, until, timeouts)
        return
    with dask_module.config.set(_DASK_SETTINGS), _connect_client(dask, timeouts) as client:
        _check_workers(client, dask, folder, asked := versions())
        cluster = Cluster(client, until, timeouts)
        name = f"streetloom {client.id}"  # of this run alone: another one on the same scheduler has its own
        client.register_plugin(worker_plugin_remover(client.id, name), name=name)
        _register_plugin(client, worker_setup_plugin(asked), name)
        yield cluster


@contextmanager
def start_shared_workers(workers: int) -> Iterator[str]:
    """Start local processes for several runs at once; yields the address of their scheduler.

    Processes that are started meanwhile have its certificate in their environment, which only their owner can read.

    Raises
    ------
    ClusterGoneError : they do not start.
    """
    with _start_local_client(workers) as client:
        security = client.security
        before = dict(os.environ)
        values = (security.tls_ca_file, security.tls_client_cert, security.tls_client_key)
        os.environ.update(zip(CERTIFICATE_VARIABLES, values, strict=True))
        try:
            yield str(client.scheduler_info()["address"])
        finally:
            for name in CERTIFICATE_VARIABLES:
                os.environ.pop(name)
                os.environ.update({name: before[name]} if name in before else {})


@contextmanager
def _start_local_client(workers: int) -> Iterator[Client]:
    import dask as dask_module
    from distributed import Client

    with (
        dask_module.config.set(_DASK_SETTINGS),
        _start_local_cluster(workers) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        _register_plugin(client, worker_setup_plugin(), "streetloom")
        yield client


def _register_plugin(client: Client, plugin: WorkerPlugin, name: str) -> None:
    """Register a plugin of workers; again if one dies meanwhile, in whose place another starts.

    Raises
    ------
    ClusterGoneError : workers die each time.
    """
    from distributed.comm.core import CommClosedError

    cause: Exception | None = None
    for _ in range(PLUGIN_TRIES):
        try:
            client.register_plugin(plugin, name=name)
            return
        except CommClosedError as error:
            cause = error
    raise ClusterGoneError from cause


@contextmanager
def _prepare_for_children() -> Iterator[None]:
    """Keep what Ctrl-C in a terminal, which reaches every process of its group, would print from child processes.

    SIGINT is blocked in threads started meanwhile, and so in their processes from the first instruction on: a worker that
    imports its modules would print where it was. Python's resource tracker starts without its warning on semaphores.
    """
    from multiprocessing import resource_tracker

    filters = os.environ.get("PYTHONWARNINGS", "")
    os.environ["PYTHONWARNINGS"] = f"{filters},ignore:resource_tracker:UserWarning".removeprefix(",")
    resource_tracker.ensure_running()  # it unblocks SIGINT in this thread
    os.environ["PYTHONWARNINGS"] = filters
    signals = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, signals)


def _start_local_cluster(workers: int) -> LocalCluster:
    """Start local processes; tries again once if one dies. Raises ClusterGoneError.

    They talk by TLS with a certificate of this cluster alone: any user of the machine reaches their ports.
    """
    from distributed import LocalCluster

    place = {"host": "127.0.0.1", "dashboard_address": "127.0.0.1:0", "threads_per_worker": 1}
    cause: Exception | None = None
    for _ in range(2):
        try:
            with _prepare_for_children():
                return LocalCluster(n_workers=workers, security=True, silence_logs=logging.CRITICAL, **place)
        except Exception as error:
            log.warning("local workers do not start: %s", error)
            cause = error
    raise ClusterGoneError(
        f"{workers} local workers do not start; see to the machine's memory and to its limit of open files (`ulimit -n`), or "
        "name fewer with --workers"
    ) from cause


def require_scheduler(address: str, within: float = DEFAULT_TIMEOUTS.connect) -> None:
    """Check that a port listens within so many seconds; a Dask client takes long to find that there is none.

    Raises
    ------
    InputError : none listens.
    """
    from distributed.comm.addressing import parse_address, parse_host_port
    from distributed.security import Security

    if address.startswith("tls:") and not Security().get_connection_args("client").get("ssl_context"):
        raise InputError(
            f"--dask {address}: a certificate is needed; name its files by {', '.join(CERTIFICATE_VARIABLES)}"
        )
    try:
        scheme, place = parse_address(address)
        if scheme not in ("tcp", "tls"):
            raise ValueError(f"not a Dask address: {address!r}")
        socket.create_connection(parse_host_port(place), timeout=within).close()
    except (ValueError, OSError, OverflowError) as error:
        raise InputError(f"--dask {address}: no scheduler answers there; {START_SCHEDULER}") from error


@contextmanager
def _connect_client(address: str, timeouts: Timeouts) -> Iterator[Client]:
    from distributed import Client

    require_scheduler(address, timeouts.connect)
    try:
        client = Client(address, timeout=timeouts.connect, set_as_default=False)
    except Exception as error:  # what does not speak Dask is met with errors of every kind
        raise InputError(f"--dask {address}: no scheduler answers there; {START_SCHEDULER}") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=timeouts.first_worker)
        except OSError as error:
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
