"""The atlas as a worker writes it."""

from __future__ import annotations

from dataclasses import dataclass

from facade_core.core.zarr_types import StoreGroup
from facade_core.plan.plan import Plan
from tasks.engine.context import load_run_plan
from tasks.engine.run import Run


@dataclass(frozen=True)
class Atlas:
    """The store of a run."""

    run: Run
    group: StoreGroup

    @property
    def plan(self) -> Plan:
        """Return the plan, with the places of the charts."""
        return load_run_plan(self.run)
