"""Stages as values. The order of a run, the journals of a store, the forecast and the carry-over follow from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from importlib import import_module
from typing import Any, NamedTuple

from catalogs.block import Block
from facade_core.atlas.arrays import BASE_ARRAYS, STAGE_ARRAYS
from facade_core.atlas.journal import Record, read_journal
from facade_core.core.zarr_types import StoreGroup
from facade_core.plan.plan import Plan
from tasks.engine.inputs import CODE, digest_inputs
from tasks.engine.processing import Compute, Write, process_units
from tasks.engine.run import Run
from tasks.engine.stage_code import stage_code_digest
from tasks.engine.unit import Unit, UnitFunction

# The module that lists the stages: imported when first asked for, as the stages import the engine.
ORDER_MODULE = "tasks.stages.order"

Records = list[Record | None]


class UnitOutline(NamedTuple):
    """Name of a unit, and the charts that it writes."""

    name: str
    charts: tuple[int, ...] = ()


@dataclass(frozen=True)
class ForecastInputs:
    """Everything that the forecast of a stage may read: earlier stages are complete.

    Attributes
    ----------
    units : all units, by stage.
    pending : reason by unit index, by stage.
    rewritten : charts whose base layer is written again.
    """

    run: Run
    block: Block
    plan: Plan
    group: StoreGroup
    units: Mapping[str, Sequence[Unit[Any]]]
    pending: Mapping[str, Mapping[int, str]]
    rewritten: Sequence[int]


# Reason by unit index.
Pending = Mapping[int, str]


def forecast_pending(_inputs: ForecastInputs, own: Pending) -> Pending:
    """Forecast the units that are pending by their keys: no other follows from earlier stages."""
    return own


@dataclass(frozen=True)
class Stage:
    """A stage of a run: one kind of units.

    Attributes
    ----------
    stage : its name in journals, keys, logs and tables.
    noun : one of its units in words.
    outline : names of all units of a block with this plan, and the charts that each writes.
    inputs : lists all units with their inputs, by the records of earlier stages in the group.
    compute : computes the result of a unit from its inputs.
    write : writes the result of a unit to its own chunks; returns the fields of its record.
    process : processes units whose results depend on each other, in place of `compute` and `write`.
    prepare : stores what its units have in common, before they are listed.
    forecast : reasons of pending units after those of earlier stages, given the units pending by key.
        None: units follow from earlier stages alone, and are not forecast.
    """

    stage: str
    noun: str
    outline: Callable[[Block, Plan], Sequence[UnitOutline]]
    inputs: Callable[[Run, Block, Plan, StoreGroup], list[Unit[Any]]]
    compute: Compute[Any] | None = None
    write: Write[Any] | None = None
    process: UnitFunction | None = None
    prepare: Callable[[Run, Block, Plan], None] | None = None
    forecast: Callable[[ForecastInputs, Pending], Pending] | None = forecast_pending

    @property
    def function(self) -> UnitFunction:
        """Return the function that processes some of its units on a worker; it can be pickled."""
        if self.process is not None:
            return self.process
        if self.compute is None or self.write is None:
            raise TypeError(f"{self.stage} have neither `process` nor `compute` and `write`")
        return partial(process_units, self.compute, self.write)

    def list_units(self, run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit[Any]]:
        """List all units, with the digests of their inputs and of the code."""
        code = stage_code_digest(self.stage)
        units = self.inputs(run, block, plan, group)
        return [replace(unit, digests={CODE: code, **digest_inputs(unit.inputs)}) for unit in units]

    @property
    def subject(self) -> str:
        """Return the catalogue's word for the subject of a unit: "building" for a textured building."""
        return self.noun.rpartition(" ")[2]

    @property
    def writes_base_layer(self) -> bool:
        """Return whether its records hold digests of charts that later stages read."""
        return STAGE_ARRAYS.get(self.stage) is BASE_ARRAYS


def stored_files(record: Record | None) -> Mapping[str, str]:
    """Return the stored files of a unit, path -> digest; none if it is not done."""
    return record.get("files", {}) if record and record["status"] == "done" else {}


@cache
def all_stages() -> tuple[Stage, ...]:
    """Return the stages in the order of a run."""
    stages: tuple[Stage, ...] = import_module(ORDER_MODULE).STAGES_IN_ORDER
    return stages


def code_stage_names() -> tuple[str, ...]:
    """Return the names of the stages that have code of their own, with those before and after the units."""
    names: tuple[str, ...] = import_module(ORDER_MODULE).CODE_STAGES
    return names


def read_journals(group: StoreGroup) -> dict[str, Records]:
    """Read the records of every stage by unit index, None for a unit without a record."""
    return {stage.stage: read_journal(group, stage.stage) for stage in all_stages()}


def is_done_record(record: Record | None) -> bool:
    """Return whether a record says that its unit is done."""
    return record is not None and record["status"] == "done"


def match_units_by_name(records: Sequence[Record | None], names: Sequence[str]) -> dict[int, int]:
    """Match units by name with records, new -> old."""
    return match_names([record["unit"] if record else None for record in records], names)


def match_names(before: Sequence[str | None], after: Sequence[str]) -> dict[int, int]:
    """Match equal names, new -> old; the first of several with the first."""
    at: dict[str | None, list[int]] = {}
    for index, name in enumerate(before):
        at.setdefault(name, []).append(index)
    return {index: at[name].pop(0) for index, name in enumerate(after) if at.get(name)}
