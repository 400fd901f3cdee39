"""Context of a unit: the plan of its run, and the worker that processes it."""

from __future__ import annotations

from functools import lru_cache

from facade_core.atlas.store import BRANCH, open_repository
from facade_core.plan.plan import Plan
from facade_core.plan.plan_tables import read_plan
from tasks.engine.run import Run


def current_worker_name() -> str:
    """Return the name of the Dask worker that runs this unit, or "serial"."""
    import sys

    if "distributed" in sys.modules:
        from distributed import get_worker

        try:
            return str(get_worker().name)
        except ValueError:
            pass
    return "serial"


@lru_cache(maxsize=2)
def load_run_plan(run: Run) -> Plan:
    """Read a run's plan, once per process. It is written before any unit starts, so the newest snapshot holds it."""
    return read_plan(open_repository(run.store).readonly_session(BRANCH))
