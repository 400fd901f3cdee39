"""Context of a unit: the plan of its run, the store that it reads, and the worker that processes it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import lru_cache
from typing import TYPE_CHECKING

from facade_core.atlas.store import BRANCH, open_repository
from facade_core.core.zarr_types import StoreGroup
from facade_core.plan.plan import Plan
from facade_core.plan.plan_tables import read_plan
from tasks.engine.run import Run

if TYPE_CHECKING:
    from distributed import Worker
_store: ContextVar[StoreGroup] = ContextVar("store that a unit reads")


def current_worker_name() -> str:
    """Return the name of the Dask worker that runs this unit, or "serial"."""
    worker = _current_worker()
    return str(worker.name) if worker is not None else "serial"


def current_worker_threads() -> int:
    """Return the number of units that the worker of this unit runs at once."""
    worker = _current_worker()
    return worker.state.nthreads if worker is not None else 1


def _current_worker() -> Worker | None:
    if "distributed" not in sys.modules:
        return None
    from distributed import get_worker

    try:
        return get_worker()
    except ValueError:
        return None


@lru_cache(maxsize=2)
def load_run_plan(run: Run) -> Plan:
    """Read a run's plan, once per process. It is written before any unit starts, so the newest snapshot holds it."""
    return read_plan(open_repository(run.store).readonly_session(BRANCH))


@contextmanager
def reading_store(group: StoreGroup) -> Iterator[None]:
    """Let references to earlier results be read from a store."""
    token = _store.set(group)
    try:
        yield
    finally:
        _store.reset(token)


def current_store() -> StoreGroup:
    """Return the store that references to earlier results are read from."""
    return _store.get()
