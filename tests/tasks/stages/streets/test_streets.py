"""Streets: who would lose another's writes is refused, who fails says where, and nothing of them stays behind in a worker."""

from __future__ import annotations

import threading
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from catalogs.block.reader import read_block
from facade_core.atlas.journal import clear_record, read_journal
from facade_core.atlas.store import BRANCH, commit, open_repository, open_root
from facade_core.core.errors import StoreError
from facade_core.street.propagation.blend import blend_views
from tasks.engine.compute.serial import SerialCompute
from tasks.engine.context import load_run_plan
from tasks.engine.run import Run
from tasks.engine.run_key import create_run
from tasks.engine.store.commits import fork_store
from tasks.stages.ingest.task import ingest_block
from tasks.stages.streets import task
from tasks.stages.streets import worker as viewpoint
from tasks.stages.streets.redo import street_read_write_chunks
from tasks.stages.streets.task import _claim_chunks, texture_street
from tests.pipeline.stages import STREETS, texture, write_block

HERE: Any = SimpleNamespace(out="/out")
CELLS = frozenset({"0/0/0"}), frozenset({"0/0/1"})


def test_who_reads_what_another_writes_is_refused_by_name() -> None:
    with _claim_chunks(HERE, "a", CELLS[0] | CELLS[1], CELLS[0]):
        with (
            pytest.raises(StoreError, match=r"street b and street a share 1 chunks, such as 0/0/0"),
            _claim_chunks(HERE, "b", CELLS[0], frozenset()),
        ):
            pass
        with pytest.raises(StoreError, match="street c and street a"), _claim_chunks(HERE, "c", CELLS[1], CELLS[1]):
            pass


def test_readers_of_the_same_chunks_and_other_stores_run_side_by_side() -> None:
    other: Any = SimpleNamespace(out="/other")
    with (
        _claim_chunks(HERE, "a", CELLS[0] | CELLS[1], CELLS[0]),
        _claim_chunks(HERE, "b", CELLS[1], frozenset()),
        _claim_chunks(other, "a", CELLS[0], CELLS[0]),
    ):
        pass


def test_chunks_are_free_again_after_a_street_failed() -> None:
    with pytest.raises(ValueError, match="on the way"), _claim_chunks(HERE, "a", CELLS[0], CELLS[0]):
        raise ValueError("on the way")
    with _claim_chunks(HERE, "b", CELLS[0], CELLS[0]):
        pass


@pytest.fixture(scope="module")
def ready(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A small block of which no street is done."""
    folder = tmp_path_factory.mktemp("ready")
    block = write_block(folder / "in", streets={"1": STREETS["1"]}, texture={"walls": "translate"})
    return texture(block, folder / "out", stop_before="street 1").run


def fail(*arguments: Any) -> None:
    raise ValueError("it does not work")


@pytest.mark.parametrize(
    ("what", "where"), [("_process_viewpoint", "viewpoint 0"), ("write_rasters", "end of the street")]
)
def test_a_failure_names_what_failed_and_leaves_no_window(
    ready: Run, monkeypatch: pytest.MonkeyPatch, what: str, where: str
) -> None:
    monkeypatch.setattr(viewpoint, what, fail)
    ((_, reason),) = texture_street.fn(ready, 0, "1", 0, SerialCompute()).failed
    assert reason.startswith(f"{where}: stopped by an error of its own (ValueError: it does not work); mend or remove")
    assert not viewpoint._streets


def test_two_copies_of_a_viewpoint_in_one_process_do_not_share_a_window(
    ready: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A late copy, come back to its worker while the one that was started since is at work there."""

    def one() -> None:
        viewpoint.process_viewpoints(ready, fork_store(ready.store)[1], 0, [0], "key")

    def kept() -> list[np.ndarray]:
        held = viewpoint._streets[ready, 0, "key"]
        assert isinstance(held, viewpoint._Progress)
        assert held.done == 1
        return [held.window.colour.copy(), *blend_views(held.window.state)]

    one()
    alone = kept()
    viewpoint._streets.clear()
    both, see = threading.Barrier(2), viewpoint.mark_first_visible

    windows: list[Any] = []

    def together(*arguments: Any, **named: Any) -> None:
        windows.append(arguments[1])
        both.wait(300)
        see(*arguments, **named)

    monkeypatch.setattr(viewpoint, "mark_first_visible", together)
    copies = [threading.Thread(target=one) for _ in range(2)]
    for copy in copies:
        copy.start()
    for copy in copies:
        copy.join()
    assert windows[0] is not windows[1]
    assert all(np.array_equal(a, b) for a, b in zip(alone, kept(), strict=True))
    group = open_root(open_repository(ready.store).readonly_session(BRANCH))
    viewpoint._take_buffer((ready, 0, "other"), viewpoint.load_street_worker_context(ready, group), group, 0)
    assert [key for _, _, key in viewpoint._streets] == ["other"]  # a thread keeps one
    viewpoint._streets.clear()


def test_a_viewpoint_that_failed_on_a_street_that_stands_is_done_by_the_next_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    block = write_block(tmp_path / "in", streets={k: STREETS[k] for k in "12"}, texture={"walls": "translate"})
    run = texture(block, tmp_path / "out").run
    plan = load_run_plan(run)
    first = int(np.argmin(plan.wave))
    session = open_repository(run.store).writable_session(BRANCH)
    clear_record(open_root(session), "viewpoints", plan.street_viewpoints(first)[0].id)
    commit(session, "one viewpoint is due")
    with monkeypatch.context() as broken:
        broken.setattr(task, "process_viewpoints", fail)
        assert texture_street.fn(run, first, "1", 0, SerialCompute()).failed
    texture(block, tmp_path / "out")
    group = open_root(open_repository(run.store).readonly_session(BRANCH))
    assert {record["status"] for record in read_journal(group, "viewpoints") if record} == {"done"}


def test_a_street_waits_for_those_of_earlier_waves_whose_chunks_it_touches(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    block = read_block(write_block(tmp_path / "in", streets=STREETS | {"far": [(400.0, 0.0), (430.0, 0.0)]}))
    run = create_run(block, out)
    outline = ingest_block.fn(run, block)
    plan = load_run_plan(replace(run, ingested=outline.ingested))
    chunks = [street_read_write_chunks(plan, street) for street in range(len(plan.streets))]
    for street, (reads, writes) in enumerate(chunks):
        share = [other for other, (r, w) in enumerate(chunks) if other != street and (reads & w or writes & r)]
        assert outline.after[street] == tuple(o for o in share if plan.wave[o] < plan.wave[street])
    assert any(outline.after)
