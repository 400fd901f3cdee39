"""Block as a snapshot of its store holds it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from typing import cast

import icechunk

from facade_core.atlas.journal import Record, read_journal
from facade_core.atlas.store import open_root
from facade_core.atlas.table_schema import TableValues
from facade_core.core.zarr_types import StoreGroup
from facade_core.plan.plan import Plan
from facade_core.plan.plan_tables import read_plan, read_table
from tasks.engine.store.status import store_code_version
from tasks.stages.bundles.refined_poses import read_bundled_pose_records
from tasks.stages.facades.record import FacadeRecord
from tasks.stages.journals import Journals, read_typed_journals
from tasks.stages.poses.record import BundledPoseRecord


@dataclass(frozen=True)
class StoredBlock:
    """Block as a snapshot of its store holds it.

    Attributes
    ----------
    group : root group of the store.
    plan : plan of the block.
    buildings : table of the buildings: id, height and further columns.
    """

    group: StoreGroup
    plan: Plan
    buildings: TableValues

    @cached_property
    def journals(self) -> Journals:
        """Read the records of all units by stage; None for a unit without a record."""
        return read_typed_journals(self.group)

    @property
    def records_by_stage(self) -> Mapping[str, Sequence[Record | None]]:
        """Return the journals with the part of their records that all stages share."""
        return cast(Mapping[str, Sequence[Record | None]], self.journals)

    @cached_property
    def refined_poses(self) -> list[BundledPoseRecord | None]:
        """Read the pose records of panoramas, with the results of their joint adjustment."""
        return read_bundled_pose_records(self.group)

    @cached_property
    def hand_corrected_ids(self) -> frozenset[str]:
        """Return the ids of manually corrected buildings."""
        return frozenset(cast(list[str], self.group.attrs.get("corrected", [])))

    @cached_property
    def records(self) -> list[FacadeRecord | None]:
        """Read the records of the facades."""
        return read_journal(self.group, "facades", FacadeRecord)

    @cached_property
    def names(self) -> dict[int, str]:
        """Return the id of each building by index."""
        return dict(enumerate(self.buildings["id"]))

    @cached_property
    def version(self) -> str:
        """Return the version of the code that wrote the store."""
        return store_code_version(self.group)

    @property
    def ingest_time(self) -> datetime:
        """Return the time of ingestion."""
        return datetime.fromtimestamp(float(cast(float, self.group.attrs["ingested"])), UTC)


def read_stored_block(session: icechunk.Session) -> StoredBlock:
    """Read the block in the snapshot of a session.

    Errors of Icechunk, zarr and the tables propagate if the store has another version.
    """
    return StoredBlock(open_root(session), read_plan(session), read_table(session, "buildings"))
