"""Stages as values. The order of a run, the journals of a store, the forecast and the carry-over follow from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module

import icechunk

from catalogs.block import Block
from facade_core.atlas.journal import Record, read_journal
from facade_core.core.zarr_types import StoreGroup
from facade_core.plan.plan import Plan
from tasks.engine.outline import PlanSummary
from tasks.engine.run import Run
from tasks.engine.unit import Unit, UnitFunction

# The module that lists the stages: imported when first asked for, as the stages import the engine.
ORDER_MODULE = "tasks.stages.order"

Records = list[Record | None]


@dataclass(frozen=True)
class ReingestContext:
    """Inputs for carrying over the units of the last ingest to a new plan.

    Attributes
    ----------
    before : plan of the last ingest.
    after : plan of this ingest.
    group : the store as it becomes.
    last : the store as it was.
    records : the journals as they were, by stage.
    stays : charts that keep their place and their writers, new -> old. A stage removes the charts whose data
        are not valid now: they are cleared.
    """

    run: Run
    block: Block
    before: Plan
    after: Plan
    group: StoreGroup
    last: StoreGroup
    records: Mapping[str, Records]
    stays: dict[int, int] = field(default_factory=dict)


@dataclass(frozen=True)
class StageForecast:
    """Forecast of the pending units of a stage.

    Attributes
    ----------
    pending : reason by unit index.
    total : number of units; None if it is the number that the stage lists.
    note : a further remark for the line that announces the work.
    """

    pending: Mapping[int, str]
    total: int | None = None
    note: str | None = None


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
    outline: PlanSummary
    units: Mapping[str, Sequence[Unit]]
    pending: Mapping[str, Mapping[int, str]]
    rewritten: Sequence[int]


@dataclass(frozen=True)
class IntegrityInputs:
    """Inputs of a stage's search for units whose data are missing from a snapshot.

    Attributes
    ----------
    records : the journals, by stage.
    lost : units found so far, by earlier stage.
    """

    session: icechunk.Session
    group: StoreGroup
    records: Mapping[str, Records]
    lost: Mapping[str, Sequence[int]]


@dataclass(frozen=True)
class Stage:
    """A stage of a run: one kind of units.

    Attributes
    ----------
    stage : its name in journals, keys, logs and tables.
    noun : one of its units in words.
    count : number of units of a block with this plan.
    match_previous : units of the block that the last ingest had too, new -> old; their keys decide whether they are valid.
    units : all units by the journal in the group; None for a stage that is not fanned out.
    function : processes units that belong together; None likewise.
    reads : stages whose records the keys of these units digest.
    writes_base_layer : whether records hold digests of charts that later stages read.
    in_every_block : whether every block has units of it.
    relocate : takes the records of matched units at their new places and returns them as they read there; moves
        other data that the store holds by unit. The arrays have their new size by then.
    derived_only : whether its units follow from earlier stages alone: no forecast is needed.
    part_of : the stage whose code processes these units, and with whose units they are counted.
    array_folder : folder of the store with arrays whose first index is the unit.
    unit_folder : folder of the store with a group for each unit, named by its index.
    files : stored files of a unit that is done, path -> digest, by its index and record.
    follows_base_layer : whether units that write on charts whose base layer is lost are done again too.
    unit_charts : charts that each unit writes.
    unit_names : names of all units, for messages.
    find_lost : units that are done by their record and whose data are missing. No raster is read.
    confirm_lost : lost units, without those pending anyway.
    find_differing : units, by stage, whose arrays differ from the digests of their records; of a sample of this size.
    forecast : pending units after those of earlier stages, given the units pending by key; None where unknown.
    """

    stage: str
    noun: str
    count: Callable[[Block, Plan], int]
    match_previous: Callable[[ReingestContext], dict[int, int]]
    units: Callable[[Run, Block, Plan, StoreGroup], list[Unit]] | None = None
    function: UnitFunction | None = None
    reads: tuple[str, ...] = ()
    writes_base_layer: bool = False
    in_every_block: bool = False
    relocate: Callable[[ReingestContext, Mapping[int, int], Records], Records] | None = None
    derived_only: bool = False
    part_of: str | None = None
    array_folder: str | None = None
    unit_folder: str | None = None
    files: Callable[[int, Record], Mapping[str, str]] | None = None
    follows_base_layer: bool = False
    unit_charts: Callable[[Plan], Sequence[Sequence[int]]] | None = None
    unit_names: Callable[[Plan], Sequence[str]] | None = None
    find_lost: Callable[[IntegrityInputs], list[int]] | None = None
    confirm_lost: Callable[[Run, Plan, StoreGroup, Sequence[int]], list[int]] | None = None
    find_differing: Callable[[StoreGroup, Plan, int | None], Mapping[str, Sequence[int]]] | None = None
    forecast: Callable[[ForecastInputs, Mapping[int, str]], StageForecast | None] | None = None

    @property
    def subject(self) -> str:
        """Return the catalogue's word for the subject of a unit: "building" for a textured building."""
        return self.noun.rpartition(" ")[2]

    def unit_files(self, unit: int, record: Record | None) -> Mapping[str, str]:
        """Return the stored files of a unit, path -> digest; none if it is not done."""
        return self.files(unit, record) if self.files is not None and record and record["status"] == "done" else {}


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
    at = {record["unit"]: i for i, record in enumerate(records) if record}
    return {index: at[name] for index, name in enumerate(names) if name in at}


def match_units_by_key_or_name(records: Sequence[Record | None], units: Sequence[Unit]) -> dict[int, int]:
    """Match units by key with records, else by name, new -> old. The latter are pending, with a known reason."""
    keys = {record["key"]: i for i, record in enumerate(records) if record}
    found = {unit.index: keys[unit.key] for unit in units if unit.key in keys}
    taken = set(found.values())
    names = {record["unit"]: i for i, record in enumerate(records) if record and i not in taken}
    return found | {u.index: names[u.name] for u in units if u.index not in found and u.name in names}
