"""Pending units of a stage: not done, or done for other inputs, by the journal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from catalogs.block import Block
from facade_core.atlas.journal import Record, read_journal
from tasks.engine.context import load_run_plan
from tasks.engine.run import Run
from tasks.engine.stage import Stage
from tasks.engine.store.carry_over import delete_unit_results
from tasks.engine.store.commits import open_newest_root
from tasks.engine.unit import Unit, UnitGroup


@dataclass(frozen=True)
class PendingUnits:
    """Pending units of a stage in groups for one worker each, and the records of done ones."""

    stage: Stage
    pieces: tuple[UnitGroup, ...]
    done: tuple[Record, ...]

    @property
    def total(self) -> int:
        """Return the number of units of the stage."""
        return len(self.done) + sum(map(len, self.pieces))


def find_pending_units(run: Run, block: Block, stage: Stage, units: Sequence[Unit[Any]] | None = None) -> PendingUnits:
    """Find the pending units of a stage.

    Records of pending units that write the base layer are deleted, so that later stages cannot read stale data.

    Parameters
    ----------
    units : all units of the stage, where they are known and nothing that their keys digest was done since.
    """
    plan = load_run_plan(run)
    if stage.prepare is not None:
        stage.prepare(run, block, plan)
    group = open_newest_root(run)
    records = read_journal(group, stage.stage)
    if units is None:
        units = stage.list_units(run, block, plan, group)
    waiting = [unit for unit in units if not unit.is_done(records[unit.index])]
    if stage.writes_base_layer:
        delete_unit_results(
            run, plan, stage.stage, {u.index: u.charts for u in waiting if u.charts and records[u.index]}
        )
    indices = {unit.index for unit in waiting}
    return PendingUnits(
        stage,
        tuple(_pieces(waiting)),
        tuple(record for index, record in enumerate(records) if record and index not in indices),
    )


def _pieces(units: Sequence[Unit[Any]]) -> list[UnitGroup]:
    """Group units that one worker processes in one go: corrected groups first, else by group or index."""
    alone = [(unit,) for unit in units if unit.group_id is None]
    corrected = {unit.group_id for unit in units if unit.is_corrected}
    shared = sorted(
        (unit for unit in units if unit.group_id is not None),
        key=lambda unit: (unit.group_id not in corrected, unit.group_id or 0),
    )
    return [*alone, *(tuple(piece) for _, piece in groupby(shared, key=lambda unit: unit.group_id))]
