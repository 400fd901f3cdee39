"""What makes a process fit to run units: on a cluster's workers, late ones too, and in this process."""

from __future__ import annotations

import asyncio
import os
import signal
import threading
from collections.abc import Callable
from typing import Any

# Libraries must not spread over the cores that other workers use, nor change sums with the number of threads.
ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")}

_thread = threading.local()


def run_unit(function: Callable[..., Any], *arguments: Any) -> Any:
    """Run a unit in this thread, with libraries that keep to it."""
    if not hasattr(_thread, "limited"):  # OpenMP keeps a number for each thread that calls it
        limit_threads()
        _thread.limited = True
    return function(*arguments)


def limit_threads() -> None:
    """Keep libraries to one thread each: those loaded in what runs in this thread, those loaded later everywhere."""
    os.environ.update(ONE_THREAD)
    import cv2
    import scipy.linalg  # noqa: F401 its pool is the whole process's, and better limited before anything runs
    import zarr
    from threadpoolctl import threadpool_limits

    # chunks are small, and coded sooner than handed from thread to thread one by one
    zarr.config.set({"threading.max_workers": 1, "codec_pipeline.batch_size": 256})
    cv2.setNumThreads(1)
    threadpool_limits(1)


def prepared(ours: bool) -> Any:
    """A plugin that prepares every worker, those that join later too; `ours` are the processes of this run."""
    from distributed import WorkerPlugin

    class Prepared(WorkerPlugin):
        async def setup(self, worker: Any) -> None:
            if ours:  # Ctrl-C in a terminal reaches every process of its group; workers end with the run, in silence
                signal.signal(signal.SIGINT, signal.SIG_IGN)
            limit_threads()
            # Awaited: a unit that arrives meanwhile would import the same modules from another thread, the other way round.
            await asyncio.to_thread(_load)

    return Prepared()


def _load() -> None:
    """Import what units need while the block is ingested: a worker's first unit would wait seconds for it."""
    import onnxruntime  # noqa: F401
    import skimage.measure  # noqa: F401
    import xarray  # noqa: F401

    import tasks.units.exemplar
    import tasks.units.facade
    import tasks.units.viewpoint  # noqa: F401


def standing(token: str) -> tuple[bool, str]:
    """Of a worker: whether it sees a file and can write beside it, and the version of its code."""
    from tasks.run import code_version

    return os.path.isfile(token) and os.access(os.path.dirname(token), os.W_OK), code_version()
