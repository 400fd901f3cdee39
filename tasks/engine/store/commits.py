"""A unit's data and its journal records, in one commit; the tags of those in which a street ended."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import icechunk

from catalogs.features import file_stem
from facade_core.atlas.journal import Record, read_journal, unit_key, write_record
from facade_core.atlas.location import Place
from facade_core.atlas.store import BRANCH, commit, open_repository, open_root
from facade_core.core.zarr_types import StoreGroup


def begin(store: Place) -> tuple[icechunk.Session, Any]:
    """A session on the newest snapshot and a fork of it for one worker."""
    session = open_repository(store).writable_session(BRANCH)
    return session, session.fork()


def finish(session: icechunk.Session, fork: Any, stage: str, records: Mapping[int, Record], message: str) -> str:
    """Commit a fork's data together with its journal records (unit index -> record); returns the snapshot id."""
    session.merge(fork)
    group = open_root(session)
    for index, record in records.items():
        write_record(group, stage, index, record)
    return commit(session, message)


def journal(store: Place, stage: str) -> list[Record | None]:
    """The records of a stage at the newest snapshot."""
    session = open_repository(store).readonly_session(BRANCH)
    return read_journal(open_root(session), stage)


def tag_of(record: Record) -> str:
    """The tag of the snapshot in which a street ended, by the street's record."""
    return f"street-{file_stem(record['unit'])}-{unit_key(record['key'])[:12]}"


def standing_tags(group: StoreGroup) -> set[str]:
    """The tags of the streets that a snapshot holds as done."""
    return {tag_of(record) for record in read_journal(group, "streets") if record and record["status"] == "done"}
