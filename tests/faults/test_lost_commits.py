"""Threads that commit into one store at once: a commit that is said to be made is in the history."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
import zarr

from facade_core.atlas.arrays import create_arrays
from facade_core.atlas.journal import read_journal
from facade_core.atlas.store import BRANCH, Repository, commit, create_root, open_repository
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.errors import StoreError
from tasks.engine.store.carry_over import delete_unit_results
from tasks.engine.store.commits import commit_units, fork_store

THREADS, ROUNDS = 4, 40


@pytest.fixture
def store(tmp_path: Path) -> Path:
    session = open_repository(tmp_path / "store", create=True).writable_session(BRANCH)
    units = {"poses": 0, "exemplars": 1, "textures": 1, "facades": 1, "streets": THREADS * ROUNDS}
    spec = AtlasSpec(1, 20.0, page=256)
    create_arrays(create_root(session), spec, units, crs="EPSG:32635")
    commit(session, "arrays")
    return tmp_path / "store"


def test_no_commit_is_lost_among_threads_that_finish_units_and_forget_units(store: Path) -> None:
    scene = SimpleNamespace(spec=None, placement=None)  # no chart is cleared
    run, plan = cast(Any, SimpleNamespace(store=store)), cast(Any, SimpleNamespace(scene=scene))

    def texture(thread: int) -> list[str]:
        """Units one after the other, with one that is due again now and then."""
        made = []
        for unit in range(thread * ROUNDS, (thread + 1) * ROUNDS):
            session, fork = fork_store(store)
            made.append(commit_units(session, fork, "streets", {unit: {"unit": str(unit), "key": "k"}}, str(unit)))
            if unit % 2:
                delete_unit_results(run, plan, "streets", {unit: []})
        return made

    with ThreadPoolExecutor(THREADS) as threads:
        made = [snapshot for found in threads.map(texture, range(THREADS)) for snapshot in found]
    repository = open_repository(store)
    history = [snapshot.id for snapshot in repository.ancestry(branch=BRANCH)]
    assert set(made) <= set(history)
    assert len(history) == 2 + THREADS * (ROUNDS + ROUNDS // 2)
    records = read_journal(zarr.open_group(repository.readonly_session(BRANCH).store, mode="r"), "streets")
    assert [bool(record) for record in records] == [True, False] * (THREADS * ROUNDS // 2)


def test_a_commit_that_another_process_overwrote_is_said(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    session, fork = fork_store(store)
    monkeypatch.setattr(Repository, "lookup_branch", lambda repository, branch: "ELSEWHERE")
    with pytest.raises(StoreError, match=r"^unit: the commit \w+ is lost.*another process writes.*run again$"):
        commit_units(session, fork, "streets", {0: {"unit": "0", "key": "k"}}, "unit")
