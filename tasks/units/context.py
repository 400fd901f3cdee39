"""What a worker keeps between units: a run's plan and translator, read once per process."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from facade_core.atlas.store import BRANCH, open_repository
from facade_core.ingest import Plan
from facade_core.street import neural
from facade_core.street.translate import Swatches, Translator
from tasks.plan import read_plan
from tasks.roofs import roof_material
from tasks.run import Run


@dataclass(frozen=True)
class Context:
    plan: Plan
    translator: Translator


@lru_cache(maxsize=2)
def context(run: Run) -> Context:
    """The plan of a run. It is written once, before any unit starts, so the newest snapshot holds it."""
    session = open_repository(run.store).readonly_session(BRANCH)
    plan = read_plan(session, run.texels_per_metre)
    if run.translator == "neural":
        return Context(plan, neural.load())
    return Context(plan, Swatches(plan.scene, plan.streets, seed=run.seed, roof_material=roof_material(run)))


def worker_name() -> str:
    """The Dask worker that runs this unit, or "serial"."""
    import sys

    if "distributed" in sys.modules:
        from distributed import get_worker

        try:
            return str(get_worker().name)
        except ValueError:
            pass
    return "serial"


def unit_seed(run: Run, unit: str, stage: str) -> int:
    """The seed of a stage of a unit: from the block's seed, the unit's id and the stage's name, and nothing else."""
    import hashlib

    text = f"{run.seed}/{unit}/{stage}"
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=4).digest(), "big")
