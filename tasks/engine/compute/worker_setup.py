"""Setup of processes that run units: workers of a cluster, late ones too, and this process."""

from __future__ import annotations

import asyncio
import gc
import logging
import os
import platform
import threading
import time
import uuid
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from catalogs.published.folders import Folder
from catalogs.published.s3 import folder_at
from facade_core.core.errors import FacadeError
from tasks.engine.outcome import is_machine_fault, machine_error

if TYPE_CHECKING:
    from distributed import Scheduler, SchedulerPlugin, Worker, WorkerPlugin

# Libraries must not spread over the cores that other workers use, nor change sums with the number of threads.
ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")}

# Packages whose versions are named where they differ.
REPORTED_LIBRARIES = (
    *("numpy", "scipy", "opencv-python-headless", "scikit-image", "pillow", "onnxruntime"),
    "embreex",
)
# Where workers say what the run should hear.
LOG_TOPIC = "streetloom"

_thread = threading.local()

R = TypeVar("R")


def run_unit(function: Callable[..., R], *arguments: object) -> R:
    """Run a unit in this thread, with libraries limited to it.

    Raises
    ------
    MachineError : a fault of the machine; errors of libraries may lose their type on the way from a worker.
    """
    if not hasattr(_thread, "limited"):  # OpenMP keeps a number for each thread that calls it
        limit_threads()
        _thread.limited = True
    try:
        return function(*arguments)
    except Exception as error:
        if is_machine_fault(error):
            raise machine_error(f"on {os.uname().nodename}", error) from error
        raise


def run_on_worker(limit_s: float, function: Callable[..., R], *arguments: object) -> R:
    """Run a unit on a Dask worker, which exits after `limit_s`.

    Dask has no limit for a task, and no thread can be ended. A worker that does not release Python's lock to the timer sends
    no heartbeat either, so that its scheduler restarts it after `worker-ttl`.
    """
    from distributed import get_worker

    worker = get_worker()
    timer = threading.Timer(limit_s, _exit_worker, (worker, str(worker.get_current_task()), limit_s))
    timer.daemon = True
    timer.start()
    try:
        return run_unit(function, *arguments)
    finally:
        timer.cancel()


def _exit_worker(worker: Worker, key: str, limit_s: float) -> None:
    line = f"worker {worker.name} at {worker.address} did not end a unit within {limit_s:.0f} s; it exits"
    worker.log_event(LOG_TOPIC, (line, key))
    time.sleep(1)  # the event is on its way
    os._exit(1)


def limit_threads() -> None:
    """Limit libraries to one thread each."""
    os.environ.update(ONE_THREAD)
    import cv2
    import scipy.linalg  # noqa: F401 its pool is the whole process's, and better limited before anything runs
    import zarr
    from threadpoolctl import threadpool_limits

    # chunks are small, and coded sooner than handed from thread to thread one by one
    zarr.config.set({"threading.max_workers": 1, "codec_pipeline.batch_size": 256})
    cv2.setNumThreads(1)
    threadpool_limits(1)


def worker_setup_plugin(asked: dict[str, str] | None = None) -> WorkerPlugin:
    """Return a Dask plugin that prepares every worker, late ones too.

    Parameters
    ----------
    asked : environment that workers must share, None for own processes; a worker that differs logs it and closes.
    """
    from distributed import Status, WorkerPlugin

    class Prepared(WorkerPlugin):
        async def setup(self, worker: Worker) -> None:
            if asked is not None and (said := diff_environment(asked, environment_versions())):
                line = f"worker {worker.name} at {worker.address} {said}; it is not used"
                worker.log_event(LOG_TOPIC, (line, ""))
                logging.getLogger("distributed.worker").error(line)
                worker.status = Status.closing_gracefully  # it takes no unit
                # once it has started: its nanny, which is to end too, does not listen before
                worker.loop.call_later(1, worker.close, reason=line)
                return
            limit_threads()
            # Awaited: a unit that arrives meanwhile would import the same modules from another thread, the other way round.
            await asyncio.to_thread(_import_workers)

    return Prepared()


def worker_plugin_remover(client: str, name: str) -> SchedulerPlugin:
    """Return a scheduler plugin that removes the worker plugin `name` when a client leaves.

    Otherwise newer workers that join after the run would close.
    """
    from distributed import SchedulerPlugin

    class Forgotten(SchedulerPlugin):  # sent by value, being local: a scheduler need not have this code
        def remove_client(self, scheduler: Scheduler, client: str) -> None:
            if client == gone:
                scheduler.loop.add_callback(scheduler.remove_plugin, name)
                if name in scheduler.worker_plugins:
                    scheduler.loop.add_callback(scheduler.unregister_worker_plugin, None, name)

    gone = client
    return Forgotten()


def environment_versions() -> dict[str, str]:
    """Return the environment of this process: versions of Python, of libraries and of the code of all stages."""
    from tasks.engine.stage import code_stage_names
    from tasks.engine.stage_code import code_version

    versions = {"Python": ".".join(platform.python_version_tuple()[:2])}
    for library in REPORTED_LIBRARIES:
        try:
            versions[library] = version(library)
        except PackageNotFoundError:
            versions[library] = "none"
    return versions | {"Streetloom": code_version(code_stage_names())}


def diff_environment(asked: dict[str, str], theirs: dict[str, str]) -> str | None:
    """Return how a worker's environment differs, in words; None if it does not."""
    other = [
        f"{name} {theirs.get(name)} and this run {here}" for name, here in asked.items() if theirs.get(name) != here
    ]
    return f"has {other[0]}" if other else None


def _import_workers() -> None:
    """Import what units need while the block is ingested, and compile it; else the first unit waits for it."""
    import onnxruntime  # noqa: F401
    import skimage.measure  # noqa: F401
    import xarray  # noqa: F401

    from tasks.engine.kernel_compilation import compile_kernels_once
    from tasks.engine.stage import all_stages
    from tasks.engine.stage_code import worker_module

    for stage in all_stages():
        import_module(worker_module(stage.stage))

    compile_kernels_once()
    gc.freeze()  # the modules stay: collections need not visit them each time


def inspect_worker(token: str) -> tuple[bool, dict[str, str]]:
    """Report whether this worker can use the run's folder, and its environment."""
    return _can_see(folder_at(token)), environment_versions()


def _can_see(token: Folder) -> bool:
    if isinstance(token, Path):
        return token.is_file() and os.access(token.parent, os.W_OK)
    beside = token.parent / f"{token.name}-{uuid.uuid4().hex}"
    try:  # by the address and the credentials of the worker's own environment
        beside.touch()
        beside.unlink()
        return token.is_file()
    except (FacadeError, OSError):
        return False
