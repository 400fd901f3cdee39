"""Streets that would lose each other's writes are refused before they start."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from facade_core.errors import StoreError
from tasks.streets import _claimed

HERE: Any = SimpleNamespace(out="/out")
CELLS = frozenset({"0/0/0"}), frozenset({"0/0/1"})


def test_who_reads_what_another_writes_is_refused_by_name() -> None:
    with _claimed(HERE, "a", CELLS[0] | CELLS[1], CELLS[0]):
        with (
            pytest.raises(StoreError, match=r"street b and street a share 1 chunks, such as 0/0/0"),
            _claimed(HERE, "b", CELLS[0], frozenset()),
        ):
            pass
        with pytest.raises(StoreError, match="street c and street a"), _claimed(HERE, "c", CELLS[1], CELLS[1]):
            pass


def test_readers_of_the_same_chunks_and_other_stores_run_side_by_side() -> None:
    other: Any = SimpleNamespace(out="/other")
    with (
        _claimed(HERE, "a", CELLS[0] | CELLS[1], CELLS[0]),
        _claimed(HERE, "b", CELLS[1], frozenset()),
        _claimed(other, "a", CELLS[0], CELLS[0]),
    ):
        pass


def test_chunks_are_free_again_after_a_street_failed() -> None:
    with pytest.raises(ValueError, match="on the way"), _claimed(HERE, "a", CELLS[0], CELLS[0]):
        raise ValueError("on the way")
    with _claimed(HERE, "b", CELLS[0], CELLS[0]):
        pass
