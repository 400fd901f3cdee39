"""Commits: the data of units and their journal records in one commit."""

from __future__ import annotations

from collections.abc import Mapping

import icechunk

from facade_core.atlas.journal import Record, read_journal, write_record
from facade_core.atlas.store import BRANCH, commit, open_repository, open_root
from facade_core.atlas.store_location import StoreLocation
from facade_core.core.zarr_types import StoreGroup
from tasks.engine.run import Run


def fork_store(store: StoreLocation) -> tuple[icechunk.Session, icechunk.ForkSession]:
    """Open a session on the newest snapshot, and fork it for one worker."""
    session = open_repository(store).writable_session(BRANCH)
    return session, session.fork()


def commit_units(
    session: icechunk.Session, fork: icechunk.ForkSession, stage: str, records: Mapping[int, Record], message: str
) -> str:
    """Commit a fork's data together with its journal records (unit index -> record); returns the snapshot id."""
    session.merge(fork)
    group = open_root(session)
    for index, record in records.items():
        write_record(group, stage, index, record)
    return commit(session, message)


def read_newest_journal(store: StoreLocation, stage: str) -> list[Record | None]:
    """Read the records of a stage at the newest snapshot."""
    session = open_repository(store).readonly_session(BRANCH)
    return read_journal(open_root(session), stage)


def open_newest_root(run: Run) -> StoreGroup:
    """Open the newest snapshot of a run's store for reading."""
    return open_root(open_repository(run.store).readonly_session(BRANCH))
