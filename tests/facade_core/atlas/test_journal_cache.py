"""A journal that is held reads as the store has it, whatever was committed since, and what did not change is not read again."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from facade_core.atlas.arrays import journal_array_spec
from facade_core.atlas.journal import read_journal, write_record
from facade_core.atlas.journal_cache import cache_journals
from facade_core.atlas.store import BRANCH, commit, open_repository, open_root
from facade_core.core.atlas_spec import DimensionAndChunkSize

# Longer than what Icechunk keeps in manifests: each record is a file of its own.
LONG = np.random.default_rng(0).bytes(2000).hex()


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Path]:
    open_repository(tmp_path / "store", create=True)
    _resize(tmp_path / "store", 3)
    with cache_journals(tmp_path / "store"):
        yield tmp_path / "store"


def _resize(store: Path, units: int) -> None:
    session = open_repository(store).writable_session(BRANCH)
    journal_array_spec("facades").resize(open_root(session), {"facade": DimensionAndChunkSize(units, 1)})
    commit(session, "size")


def _write(store: Path, **records: str) -> str:
    session = open_repository(store).writable_session(BRANCH)
    for name, reason in records.items():
        write_record(open_root(session), "facades", "abc".index(name), _record(name, reason))
    return commit(session, "records")


def _record(name: str, reason: str) -> Any:
    return {"unit": name, "key": LONG, "status": "done", "reason": reason}


def _reasons(store: Path) -> list[str | None]:
    group = open_root(open_repository(store).readonly_session(BRANCH))
    return [record and record["reason"] for record in read_journal(group, "facades")]


def test_what_is_committed_is_read(store: Path) -> None:
    assert _reasons(store) == [None] * 3
    _write(store, a="1", b="1")
    assert _reasons(store) == ["1", "1", None]
    for number in "234":
        _write(store, b=number)
    assert _reasons(store) == ["1", "4", None]


def test_what_did_not_change_is_not_read_again(store: Path) -> None:
    _write(store, a="1")
    chunks = set((store / "chunks").iterdir())
    _write(store, b="1")
    assert _reasons(store) == ["1", "1", None]
    for chunk in chunks:
        chunk.unlink()
    _write(store, c="1")
    assert _reasons(store) == ["1", "1", "1"]


def test_a_session_reads_what_it_writes(store: Path) -> None:
    _write(store, a="1")
    assert _reasons(store) == ["1", None, None]
    session = open_repository(store).writable_session(BRANCH)
    group = open_root(session)
    assert read_journal(group, "facades")[0] == _record("a", "1")
    write_record(group, "facades", 0, _record("a", "2"))
    assert read_journal(group, "facades")[0] == _record("a", "2")
    assert _reasons(store) == ["1", None, None]


def test_a_store_that_went_back_or_was_resized_is_read_anew(store: Path) -> None:
    first = _write(store, a="1")
    _write(store, a="2")
    assert _reasons(store) == ["2", None, None]
    open_repository(store).reset_branch(BRANCH, first)
    assert _reasons(store) == ["1", None, None]
    _write(store, c="1")
    assert _reasons(store) == ["1", None, "1"]
    _resize(store, 2)
    _resize(store, 3)
    assert _reasons(store) == ["1", None, None]


def test_a_reading_that_fails_is_tried_again(store: Path) -> None:
    _write(store, a="1")
    assert _reasons(store) == ["1", None, None]
    chunks = set((store / "chunks").iterdir())
    _write(store, a="2")
    (chunk,) = set((store / "chunks").iterdir()) - chunks
    chunk.rename(store / "away")
    for _ in range(2):
        with pytest.raises(Exception, match=r"not found|No such|reading"):
            _reasons(store)
    (store / "away").rename(chunk)
    assert _reasons(store) == ["2", None, None]


def test_nothing_is_held_afterwards(tmp_path: Path) -> None:
    open_repository(tmp_path, create=True)
    _resize(tmp_path, 3)
    with cache_journals(tmp_path):
        _write(tmp_path, a="1")
        assert _reasons(tmp_path) == ["1", None, None]
    shutil.rmtree(tmp_path / "chunks")
    with pytest.raises(Exception, match=r"not found|No such|reading"):
        _reasons(tmp_path)
