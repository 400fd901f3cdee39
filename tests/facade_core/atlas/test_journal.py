"""Records come back as they were written, and a key tells its parts apart in whatever order they are named."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import zarr
from hypothesis import given, settings
from hypothesis import strategies as st

from facade_core.atlas.journal import clear_record, read_journal, read_records, unit_key, write_record

SCALARS = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text()
VALUES = st.recursive(SCALARS, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=4)
RECORDS = st.dictionaries(st.text(), VALUES, max_size=4)


def turned(value: Any) -> Any:
    """The same, its names in the opposite order."""
    if isinstance(value, dict):
        return {name: turned(value[name]) for name in reversed(value)}
    return [turned(inner) for inner in value] if isinstance(value, list) else value


@settings(max_examples=30)
@given(st.lists(VALUES, max_size=4), st.lists(VALUES, max_size=4))
def test_keys_are_equal_where_their_parts_are(parts: list[Any], others: list[Any]) -> None:
    assert unit_key(*parts) == unit_key(*turned(parts))
    same = json.dumps(parts, sort_keys=True) == json.dumps(others, sort_keys=True)
    assert (unit_key(*parts) == unit_key(*others)) == same
    assert unit_key(*parts) != unit_key(*parts, None)
    assert unit_key(parts) != unit_key(*parts)


@settings(max_examples=10)
@given(st.lists(st.none() | RECORDS.filter(bool), min_size=1, max_size=5), st.integers(0, 4))
def test_records_come_back(records: list[dict[str, Any] | None], forgotten: int) -> None:
    group = zarr.create_group({})
    group.create_array("journal/facades", shape=(len(records),), chunks=(1,), dtype=str)
    for index, record in enumerate(records):
        if record is not None:
            write_record(group, "facades", index, record)
    assert read_journal(group, "facades") == records
    backwards = np.arange(len(records))[::-1]
    assert read_records(group, "facades", backwards) == records[::-1]
    index = forgotten % len(records)
    clear_record(group, "facades", index)
    assert read_journal(group, "facades") == [*records[:index], None, *records[index + 1 :]]


def test_of_a_stage_that_is_newer_than_the_store_nothing_is_known() -> None:
    group = zarr.create_group({})
    clear_record(group, "walls", 0)
    assert read_records(group, "walls", np.array([1, 0])) == [None, None]
    assert read_journal(group, "walls") == []
