"""Forecast of the work of a run: the units of an earlier run that are done again, with the reasons, in one line."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from catalogs.block import Block
from catalogs.printable_text import format_unit_reason
from facade_core.atlas.journal import read_journal
from facade_core.core.zarr_types import StoreGroup
from facade_core.plan.plan import Plan
from tasks.engine.context import load_run_plan
from tasks.engine.outline import PlanSummary
from tasks.engine.pending_reasons import pending_reasons
from tasks.engine.run import Run
from tasks.engine.stage import ForecastInputs, all_stages
from tasks.engine.store.commits import open_newest_root
from tasks.engine.unit import Unit

NOTHING_PENDING = "nothing is pending except publication"
# Buildings that the line names.
MAX_NAMED_BUILDINGS = 3


@dataclass(frozen=True)
class WorkForecast:
    """Work of a run before it starts.

    Attributes
    ----------
    said : one line on the units that are done again; None without an earlier run.
    units : all units by stage, by the journal at that time.
    """

    said: str | None = None
    units: Mapping[str, Sequence[Unit[Any]]] = field(default_factory=dict)


def forecast_work(run: Run, block: Block, outline: PlanSummary) -> WorkForecast:
    """Find the units of an earlier run that are pending again, by stage and reason.

    Each stage may add units that follow from the pending ones of earlier stages (`Stage.forecast`).
    """
    if outline.anew:
        return WorkForecast(f"everything is pending: {outline.anew}")
    group = open_newest_root(run)
    if not _has_earlier_run(group):
        return WorkForecast()
    plan = load_run_plan(run)
    units: dict[str, list[Unit[Any]]] = {}
    pending: dict[str, Mapping[int, str]] = {}
    rewritten: list[int] = []
    for stage in all_stages():
        if stage.forecast is None:
            continue
        units[stage.stage] = stage.list_units(run, block, plan, group)
        own = pending_reasons(read_journal(group, stage.stage), units[stage.stage])
        found = stage.forecast(ForecastInputs(run, block, plan, group, units, pending, rewritten), own)
        pending[stage.stage] = found
        if stage.writes_base_layer:
            rewritten += [chart for u in units[stage.stage] if u.index in found for chart in u.charts]
    known = [stage for stage in all_stages() if stage.stage in pending]
    parts = [*filter(None, (_line(len(units[one.stage]), one.noun, pending[one.stage]) for one in known))]
    said = f"pending: {', '.join(parts)}; the rest is up to date" if parts else NOTHING_PENDING
    said += _describe_buildings(plan, rewritten)
    return WorkForecast(said, units)


def _describe_buildings(plan: Plan, charts: Sequence[int]) -> str:
    """Return the buildings that get other textures, as an end of the line; empty without any."""
    building = plan.scene.charts.building
    names = [plan.scene.names[one] for one in np.unique(building[list(charts)]).tolist() if one >= 0]
    if not names:
        return ""
    more = f" and {len(names) - MAX_NAMED_BUILDINGS} more" if len(names) > MAX_NAMED_BUILDINGS else ""
    count = len(np.unique(building[building >= 0]))
    return f"; walls change at {len(names)} of {count} buildings ({', '.join(names[:MAX_NAMED_BUILDINGS])}{more})"


def describe_rejected_inputs(set_aside: Iterable[Sequence[str]]) -> list[str]:
    """Return a line for each kind of input that cannot be used, of inputs as (kind, id, reason)."""
    found: dict[str, list[tuple[str, str]]] = {}
    for kind, unit, reason in set_aside:
        found.setdefault(kind, []).append((unit, reason))
    lines = []
    for kind, units in found.items():
        unit, reason = units[0]
        more = f"; {len(units) - 1} more {kind}{'s' if len(units) > 2 else ''}" if len(units) > 1 else ""
        lines.append(f"{kind} set aside: {format_unit_reason(unit, reason)}{more}")
    return lines


def _has_earlier_run(group: StoreGroup) -> bool:
    """Return whether a stage after the base layer was reached: less is resumed, not done again."""
    stages = all_stages()
    first = 1 + max(index for index, stage in enumerate(stages) if stage.writes_base_layer)
    return any(any(read_journal(group, stage.stage)) for stage in stages[first:])


def _line(total: int, noun: str, pending: Mapping[int, str]) -> str | None:
    """Return a text such as "3 of 202 facades (2: photo changed, 1: new)"; None without pending units."""
    if not pending:
        return None
    reasons = Counter(pending.values()).most_common()
    why = reasons[0][0] if len(reasons) == 1 else ", ".join(f"{count}: {reason}" for reason, count in reasons)
    return f"{len(pending)} of {total} {noun if total == 1 else noun + 's'} ({why})"
