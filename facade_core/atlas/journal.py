"""Journal: one record per unit of work, in the same commit as the unit's data.

Each stage has a string array with one element and one chunk per unit. A record is JSON with at least `unit` and `key`.
A unit is done if its record's key equals the key of its current inputs.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Sequence
from typing import Required, TypedDict, TypeVar, overload

from facade_core.atlas.journal_cache import read_cached_array, read_elements
from facade_core.core.arrays import IntArray
from facade_core.core.zarr_types import StoreGroup


class Record(TypedDict, total=False):
    """Journal entry of a unit: the part that all stages share.

    Each stage extends it (`tasks/stages/<stage>/record.py`).

    Attributes
    ----------
    unit : name of the unit.
    key : digest of its inputs.
    status : done, failed, or stale: known and pending again.
    reason : why it failed or is stale, or which picture was rejected.
    traceback : traceback of `reason`.
    worker : worker that processed it.
    started : start, seconds since 1970.
    seconds : duration of each step.
    digests : of stages that write charts, the digest of each chart by its id.
    is_complete : of these, whether every texel of the charts has a source; absent where none has.
    files : of stages that write files, the digest of each by its path.
    """

    unit: Required[str]
    key: Required[str]
    status: Required[str]
    reason: str
    traceback: str
    worker: str
    started: float
    seconds: dict[str, float]
    digests: dict[str, str]
    is_complete: bool
    files: dict[str, str]


R = TypeVar("R", bound=Record)

# Folder of the journals in a store.
JOURNAL = "journal"

# Fields that may differ between two runs of a unit on the same input.
VOLATILE_FIELDS = ("worker", "seconds", "started", "commits", "traceback")


def journal_path(stage: str) -> str:
    """Return the path of a stage's journal in a store."""
    return f"{JOURNAL}/{stage}"


@overload
def read_journal(group: StoreGroup, stage: str) -> list[Record | None]: ...


@overload
def read_journal(group: StoreGroup, stage: str, record_type: type[R]) -> list[R | None]: ...


def read_journal(group: StoreGroup, stage: str, record_type: type[Record] = Record) -> Sequence[object]:
    """Read all records of a stage by unit index, None for a unit without one.

    The list is empty if the store is older than the stage.

    Parameters
    ----------
    record_type : type of the stage's records.
    """
    if journal_path(stage) not in group:
        return []
    return [json.loads(text) if text else None for text in read_cached_array(group, journal_path(stage))]


@overload
def read_records(group: StoreGroup, stage: str, units: IntArray) -> list[Record | None]: ...


@overload
def read_records(group: StoreGroup, stage: str, units: IntArray, record_type: type[R]) -> list[R | None]: ...


def read_records(
    group: StoreGroup, stage: str, units: IntArray, record_type: type[Record] = Record
) -> Sequence[object]:
    """Read the records of some units of a stage, in their order; all None if the store is older than the stage.

    Parameters
    ----------
    units : (n,) unit indices.
    record_type : type of the stage's records.
    """
    if journal_path(stage) not in group:
        return [None] * len(units)
    texts: Iterable[object] = read_elements(group[journal_path(stage)], units) if len(units) else ()
    return [json.loads(str(text)) if text else None for text in texts]


def write_record(group: StoreGroup, stage: str, index: int, record: Record) -> None:
    """Write the record of a unit as JSON."""
    group[journal_path(stage)][index] = json.dumps(record, sort_keys=True, allow_nan=False)


def clear_record(group: StoreGroup, stage: str, index: int) -> None:
    """Clear the record of a unit, so that the unit is pending.

    Does nothing if the store is older than the stage.
    """
    if journal_path(stage) in group:
        group[journal_path(stage)][index] = ""


def unit_key(*parts: object) -> str:
    """Return the key of a unit: a digest of all inputs of its result.

    Inputs are strings, numbers, and nested lists and dicts of them.
    """
    return hashlib.blake2b(json.dumps(parts, sort_keys=True).encode(), digest_size=16).hexdigest()


def latest_chart_digests(records: Sequence[Record | None]) -> dict[str, str]:
    """Return the digest of every chart by its id, as its last writer left it.

    Parameters
    ----------
    records : records of stages that write one layer; no two of them share a chart.
    """
    charts: dict[str, str] = {}
    for record in records:
        if record:
            charts.update(record.get("digests", {}))
    return charts


def atlas_digest(group: StoreGroup) -> str:
    """Return one digest of the whole atlas: the charts' digests in the order of their ids.

    Independent of the charts' place on the pages.
    """
    charts = latest_chart_digests(read_journal(group, "surfaces"))
    digest = hashlib.sha256()
    for name in sorted(charts):
        digest.update(f"{name}:{charts[name]}\n".encode())
    return digest.hexdigest()
