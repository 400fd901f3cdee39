"""Runs over stores that earlier versions made: one of this format goes on, one of another begins anew and is said so."""

from __future__ import annotations

from pathlib import Path

import pytest

from catalogs.block.reader import Block, read_block
from facade_core.atlas.arrays import STORE_FORMAT
from facade_core.atlas.journal import read_journal
from facade_core.atlas.store import commit, open_repository, open_root
from facade_core.core.errors import StoreFormatError
from tasks.engine.run import Run
from tasks.engine.run_key import create_run
from tasks.engine.store.integrity import repair_store
from tasks.history import after_viewpoint
from tasks.stages.ingest.task import ingest_block
from tasks.viewing.run_view import RunReader
from tests.facade_core.atlas.stores import BUILDINGS, PACKED_STORE, STREETS, unpack
from tests.pipeline.stages import write_block


@pytest.fixture
def before(tmp_path: Path) -> tuple[Run, Block]:
    """A block whose store was made when its format was new."""
    out = unpack(PACKED_STORE, tmp_path / "out")
    block = read_block(write_block(tmp_path / "in", buildings=BUILDINGS, streets=STREETS))
    run = create_run(block, out)
    return run, block


def test_a_store_of_before_goes_on(before: tuple[Run, Block]) -> None:
    run, block = before
    held = open_root(open_repository(run.store).readonly_session("main"))
    assert repair_store(run) == []
    outline = ingest_block.fn(run, block)
    assert outline.anew is None
    group = open_root(open_repository(run.store).readonly_session("main"))
    assert group.attrs["format"] == STORE_FORMAT
    for stage in ("exemplars", "facades", "streets", "surfaces"):
        records, were = read_journal(group, stage), read_journal(held, stage)
        assert all(records)
        assert list(records) == list(were)
    for path in ("atlas/colour", "atlas/provenance", "facade_maps/labels"):
        assert held[path][:].any()
        assert (group[path][:] == held[path][:]).all()


def test_a_store_of_another_format_begins_anew(before: tuple[Run, Block]) -> None:
    run, block = before
    session = open_repository(run.store).writable_session("main")
    open_root(session).attrs["format"] = STORE_FORMAT + 1
    commit(session, "as a later version")
    said = f"is of format {STORE_FORMAT + 1}, and .* reads {STORE_FORMAT}; "
    said += f"`streetloom run BLOCK.yaml --out {run.out}` makes it anew"
    with pytest.raises(StoreFormatError, match=said):
        RunReader(Path(run.out)).open_newest()
    with pytest.raises(StoreFormatError, match=said):
        after_viewpoint(run.out, "s1", 0)
    assert repair_store(run) == []
    assert ingest_block.fn(run, block).anew == "another version of Streetloom made the store"
    group = open_root(open_repository(run.store).readonly_session("main"))
    assert group.attrs["format"] == STORE_FORMAT
    assert not any(read_journal(group, "facades"))
