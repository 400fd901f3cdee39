"""Context of a unit: the plan of its run, the store that it reads, and the worker that processes it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import lru_cache

from facade_core.atlas.store import BRANCH, open_repository
from facade_core.core.zarr_types import StoreGroup
from facade_core.plan.plan import Plan
from facade_core.plan.plan_tables import read_plan
from tasks.engine.run import Run

_store: ContextVar[StoreGroup] = ContextVar("store that a unit reads")


def current_worker_name() -> str:
    """Return the name of the Dask worker that runs this unit, or "serial"."""
    if "distributed" not in sys.modules:
        return "serial"
    from distributed import get_worker

    try:
        return str(get_worker().name)
    except ValueError:
        return "serial"


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
