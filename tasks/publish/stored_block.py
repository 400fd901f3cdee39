"""A block as one snapshot of its store holds it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from typing import TYPE_CHECKING, cast

from facade_core.atlas.journal import Record, read_journal
from facade_core.atlas.store import open_root
from facade_core.core.zarr_types import StoreGroup
from facade_core.plan.plan import Plan
from facade_core.plan.plan_tables import Values, read_plan, read_table
from tasks.engine.store.status import store_code_version
from tasks.stages.bundles.refined_poses import read_refined_poses
from tasks.stages.facades.record import FacadeRecord
from tasks.stages.journals import Journals, read_typed_journals
from tasks.stages.poses.record import RefinedPoseRecord

if TYPE_CHECKING:
    import icechunk


@dataclass(frozen=True)
class StoredBlock:
    """A block as a snapshot of its store holds it: root group, plan, and the table of its buildings (id, height ...)."""

    group: StoreGroup
    plan: Plan
    buildings: Values

    @cached_property
    def journals(self) -> Journals:
        """Stage -> the record of every unit, None where there is none."""
        return read_typed_journals(self.group)

    @property
    def records_by_stage(self) -> Mapping[str, Sequence[Record | None]]:
        """Return the journals with the part of their records that all stages share."""
        return cast(Mapping[str, Sequence[Record | None]], self.journals)

    @cached_property
    def refined_poses(self) -> list[RefinedPoseRecord | None]:
        """Those of panoramas, with what was made of them together."""
        return read_refined_poses(self.group)

    @cached_property
    def corrected(self) -> frozenset[str]:
        """The buildings that somebody corrected."""
        return frozenset(cast(list[str], self.group.attrs.get("corrected", [])))

    @cached_property
    def records(self) -> list[FacadeRecord | None]:
        """Those of the facades."""
        return read_journal(self.group, "facades", FacadeRecord)

    @cached_property
    def names(self) -> dict[int, str]:
        """Building -> its id."""
        return dict(enumerate(self.buildings["id"]))

    @cached_property
    def version(self) -> str:
        """That of the code that made it."""
        return store_code_version(self.group)

    @property
    def ingested(self) -> datetime:
        return datetime.fromtimestamp(float(cast(float, self.group.attrs["ingested"])), UTC)


def read_stored_block(session: icechunk.Session) -> StoredBlock:
    """The block in a session's snapshot. Raises as Icechunk, zarr and the tables do where that is none of this version."""
    return StoredBlock(open_root(session), read_plan(session), read_table(session, "buildings"))
