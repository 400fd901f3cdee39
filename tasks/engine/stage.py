"""A kind of units, as a value. What a run does in which order, how many records the store holds, what is told of units that are
due, and what a changed block keeps, all follow from the kinds; `order.py` lists them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from catalogs.block.reader import Block
from facade_core.atlas.journal import Record
from facade_core.core.zarr_types import StoreGroup
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.unit import Unit, UnitFunction

Records = list[Record | None]


@dataclass(frozen=True)
class Change:
    """A block that was ingested before and is again.

    before, after: its plans.
    group: the store as it becomes; last: as it was.
    records: the journals as they were, by stage.
    stays: the charts that lie where they lay and are written by the same stages, new -> old. Whoever finds that what is known
        of a chart is not true of it now takes it out: it is cleared.
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
class Stage:
    """A kind of units.

    stage: its name, everywhere.
    noun: one of its units in words.
    count: how many units a block with this plan has.
    again: which units of the block as it was are still there, new -> old; whether what is known of them is good is for their
        keys to say.
    units: all units as the journal in the group stands; None of those that are not fanned out.
    function: does units that go together; None likewise.
    reads: the stages on whose records the keys of these units stand.
    seeds: whether records hold digests of charts that later stages read.
    always: whether every block has some.
    moved: takes the records of units that are still there, at their new places, and returns them as they read there; moves what
        else the store holds by unit. The arrays have their new size by then.
    follows: whether its units follow from what earlier stages write and from nothing else of the block: what is told of those
        before a run says enough.
    part_of: the stage whose code does these units, and with whose units they count, where that is another.
    """

    stage: str
    noun: str
    count: Callable[[Block, Plan], int]
    match_previous: Callable[[Change], dict[int, int]]
    units: Callable[[Run, Block, Plan, StoreGroup], list[Unit]] | None = None
    function: UnitFunction | None = None
    reads: tuple[str, ...] = ()
    writes_base_layer: bool = False
    in_every_block: bool = False
    relocate: Callable[[Change, Mapping[int, int], Records], Records] | None = None
    derived_only: bool = False
    part_of: str | None = None

    @property
    def subject(self) -> str:
        """What the catalogue calls what a unit is of: "building" for one of the textured buildings."""
        return self.noun.rpartition(" ")[2]


def same_name(records: Sequence[Record | None], names: Sequence[str]) -> dict[int, int]:
    """Units, by the names that they have in their order, with the name of a record, new -> old."""
    at = {record["unit"]: i for i, record in enumerate(records) if record}
    return {index: at[name] for index, name in enumerate(names) if name in at}


def same_key_or_name(records: Sequence[Record | None], units: Sequence[Unit]) -> dict[int, int]:
    """Units with the same key as a record, else with the same name, new -> old. The latter are due, and known for why."""
    keys = {record["key"]: i for i, record in enumerate(records) if record}
    found = {unit.index: keys[unit.key] for unit in units if unit.key in keys}
    taken = set(found.values())
    names = {record["unit"]: i for i, record in enumerate(records) if record and i not in taken}
    return found | {u.index: names[u.name] for u in units if u.index not in found and u.name in names}
