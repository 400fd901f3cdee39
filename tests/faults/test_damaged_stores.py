"""Stores that lost something: what is gone is said and made again, what is not stays, and the result is the same."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr

from facade_core.atlas.integrity import find_unreadable_chunks, has_all_files
from facade_core.atlas.store import BRANCH, commit, open_repository
from facade_core.core.errors import LostStoreError, MachineError, StoreError
from flows.run_entry import handle_store_and_machine_faults
from tasks.doctor import examine_folder
from tasks.engine.outcome import machine_error
from tasks.engine.run import Run
from tasks.engine.store.integrity import (
    SUSPECT,
    find_lost_units,
    is_store_marked_suspect,
    mark_store_suspect,
    repair_store,
)
from tasks.engine.store.status import completion_summary
from tasks.history import after_viewpoint
from tests.pipeline.stages import digests_of, redone, started, stored_view, texture


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def tip(store: Path) -> Path:
    return store / "snapshots" / open_repository(store).lookup_branch(BRANCH)


def changed(store: Path, change: Callable[[Any], None]) -> None:
    session = open_repository(store).writable_session(BRANCH)
    change(zarr.open_group(session.store))
    commit(session, "a wound")


def flip(run: Run, path: str) -> None:
    """Flip one bit in a chunk of an array, or in the manifest that holds a small one."""
    folders = [run.store / name for name in ("chunks", "manifests")]
    before = {file for folder in folders for file in folder.iterdir()}

    def write_again(group: Any) -> None:
        group[path][...] = group[path][...]

    changed(run.store, write_again)
    written = ([file for file in folder.iterdir() if file not in before] for folder in folders)
    flip_bit(max(next(filter(None, written)), key=lambda file: file.stat().st_size))


def flip_bit(file: Path, place: float = 0.5) -> None:
    data = bytearray(file.read_bytes())
    data[int(len(data) * place)] ^= 1
    file.write_bytes(data)


def lose_view(group: Any) -> None:
    del group[stored_view(group)]


def lose_rasters(group: Any) -> None:
    group["atlas/seed_evidence"][:] = 0


def lose_exemplar(group: Any) -> None:
    exemplars = group["exemplars"]
    del exemplars[f"{min(exemplars.group_keys())}/labels"]


@pytest.mark.parametrize(
    ("wound", "said"),
    [
        (lose_view, r"store: 1 street \(s\d+\) lost what they made"),
        (lose_rasters, r"\d+ facades \(.*, \.\.\.\) lost"),
        (lose_exemplar, r"1 exemplar \(\w+\) lost"),
    ],
)
def test_a_record_without_its_data_is_found_and_due_again(run: Run, wound: Callable[[Any], None], said: str) -> None:
    assert repair_store(run) == []
    changed(run.store, wound)
    (line,) = repair_store(run)
    assert re.search(said, line)
    assert line.endswith("they are due again")
    assert repair_store(run) == []


def test_what_lost_its_data_is_made_again_and_nothing_else(textured: tuple[Path, Run], run: Run) -> None:
    out = Path(run.out)
    wanted, before = digests_of(out), started(out)
    changed(run.store, lose_view)
    assert completion_summary(run) is None
    repair_store(run)
    texture(textured[0], out)
    assert digests_of(out) == wanted
    assert redone(before, out) == {("streets", "s1")}


@pytest.mark.parametrize("damage", [cut, Path.unlink, lambda path: path.write_bytes(b"\0" * 3000)])
def test_without_its_newest_snapshot_a_run_goes_on_from_the_one_before(
    run: Run, damage: Callable[[Path], None]
) -> None:
    damage(tip(run.store))
    assert completion_summary(run) is None
    with pytest.raises(StoreError, match=r"snapshot \w+ cannot be read .*`streetloom run BLOCK.yaml --out .*` goes on"):
        after_viewpoint(Path(run.out), "s1", 0)
    said = repair_store(run)
    assert "the newest snapshot cannot be read" in said[0]
    assert "later work is pending again" in said[0]
    assert not any("\n" in line for line in said)
    assert repair_store(run) == []


@pytest.mark.parametrize("damage", [cut, Path.unlink])
def test_the_branch_is_found_again(run: Run, damage: Callable[[Path], None]) -> None:
    wanted = digests_of(Path(run.out))
    damage(run.store / "refs" / "branch.main" / "ref.json")
    assert completion_summary(run) is None
    assert len(repair_store(run)) == 1
    assert digests_of(Path(run.out)) == wanted
    assert completion_summary(run) is not None


@pytest.mark.long
def test_chunks_that_cannot_be_read_cost_their_units(textured: tuple[Path, Run], run: Run) -> None:
    out, store = Path(run.out), run.store
    wanted = digests_of(out)
    whole = open_repository(store).readonly_session(BRANCH)
    plan = {f"{name}/{array}" for name in ("charts", "mesh", "viewpoints") for array, _ in _group(whole)[name].arrays()}
    for path in sorted((store / "chunks").iterdir(), key=lambda path: path.stat().st_size)[-12:]:
        held = path.read_bytes()
        cut(path)
        if plan & set(find_unreadable_chunks(open_repository(store).readonly_session(BRANCH))):
            path.write_bytes(held)
    lost = find_unreadable_chunks(open_repository(store).readonly_session(BRANCH))
    assert lost
    assert completion_summary(run) is None
    (line,) = repair_store(run)
    assert "lost what they made" in line
    assert find_unreadable_chunks(open_repository(store).readonly_session(BRANCH)) == {}
    texture(textured[0], out)
    assert digests_of(out) == wanted


def test_a_damaged_chunk_is_said_with_its_store_and_the_remedy(run: Run) -> None:
    words = rf"{re.escape(str(run.store))}: a chunk is damaged; run again: the next run finds the damage and makes .* again$"
    with pytest.raises(MachineError, match=words), handle_store_and_machine_faults(run):
        raise machine_error("surfaces a", RuntimeError("Zstd decompression error: b'Destination buffer is too small'"))
    assert is_store_marked_suspect(run.folder)


def test_where_nothing_can_be_read_the_way_out_is_said(run: Run) -> None:
    for snapshot in (run.store / "snapshots").iterdir():
        cut(snapshot)
    assert completion_summary(run) is None
    with pytest.raises(
        LostStoreError,
        match=r"store: cannot be read \(.*\), nor any earlier snapshot; restore a copy of it, or name another",
    ):
        repair_store(run)


@pytest.mark.parametrize("gone", ["refs", "snapshots refs"])
def test_what_a_run_killed_while_it_made_the_store_left_is_begun_anew(
    tmp_path: Path, textured: tuple[Path, Run], gone: str
) -> None:
    run = replace(textured[1], out=str(tmp_path))
    open_repository(run.store, create=True)
    for name in gone.split():
        shutil.rmtree(run.store / name)
        (run.store / name).mkdir()
    assert completion_summary(run) is None
    assert repair_store(run) == []
    assert open_repository(run.store, create=True).lookup_branch(BRANCH)


def test_a_store_in_which_nothing_was_done_has_no_wounds(tmp_path: Path, textured: tuple[Path, Run]) -> None:
    run = replace(textured[1], out=str(tmp_path))
    assert repair_store(run) == []
    open_repository(run.store, create=True)
    assert repair_store(run) == []
    assert find_lost_units(open_repository(Path(textured[1].out) / "store").readonly_session(BRANCH)) == {}


def _group(session: Any) -> Any:
    return zarr.open_group(session.store, mode="r")


def test_damage_that_sizes_do_not_show_is_found_where_a_run_or_the_doctor_met_it(
    textured: tuple[Path, Run], run: Run
) -> None:
    out, wanted = Path(run.out), digests_of(Path(run.out))

    def paint(group: Any) -> None:
        """As when a block of the disk is another: valid, of the right size, and wrong."""
        view = group[stored_view(group)]
        view[:] = 255 - view[:]
        provenance = group["atlas/provenance"]
        provenance[0] = np.where(provenance[0] > 0, 1, 0)

    changed(run.store, paint)
    assert repair_store(run) == []
    mark_store_suspect(out)
    assert completion_summary(run) is None
    (line,) = repair_store(run)
    assert "lost what they made" in line
    assert "1 street (s1)" in line
    assert repair_store(run) == []
    texture(textured[0], out)
    assert digests_of(out) == wanted
    mark_store_suspect(out)
    assert repair_store(run) == []


def test_a_damaged_table_that_a_plan_may_lack_has_the_plan_made_again(textured: tuple[Path, Run], run: Run) -> None:
    out, wanted = Path(run.out), digests_of(Path(run.out))
    changed(run.store, lambda group: group["objects"].__delitem__("kind"))
    (line,) = repair_store(run)
    assert line.endswith("tables objects cannot be read; they are made again")
    assert repair_store(run) == []
    assert _group(open_repository(run.store).readonly_session(BRANCH)).attrs["plan"] == ""
    texture(textured[0], out)
    group = _group(open_repository(run.store).readonly_session(BRANCH))
    assert group.attrs["plan"]
    assert "kind" in group["objects"]
    assert digests_of(out) == wanted


@pytest.mark.parametrize("what", ["a file", "a link to nowhere"])
def test_a_store_that_is_no_folder_is_one_line(tmp_path: Path, what: str) -> None:
    store = tmp_path / "store"
    if what == "a file":
        store.touch()
    else:
        store.symlink_to(tmp_path / "nowhere")
    with pytest.raises(LostStoreError, match="store: is no folder; mount what it links to"):
        open_repository(store, create=True)


@pytest.mark.parametrize(
    ("path", "said", "anew"),
    [
        ("mesh/vertices", "tables mesh cannot be read; they are made again", set()),
        ("charts/origin", "tables charts cannot be read; they are made again", None),
        ("journal/facades", None, {"facades"}),
        ("journal/surfaces", None, {"surfaces"}),
        ("atlas/colour", "they are due again", {"surfaces"}),
        ("atlas/street_views", "they are due again", {"surfaces"}),
    ],
)
@pytest.mark.long
def test_a_flipped_bit_is_repaired_by_the_next_run(
    textured: tuple[Path, Run], run: Run, path: str, said: str | None, anew: set[str] | None
) -> None:
    out = Path(run.out)
    wanted, before = digests_of(out), started(out)
    flip(run, path)
    assert has_all_files(open_repository(run.store), run.store), "no size shows it"
    findings = [finding.message for finding in examine_folder(out) if finding.is_well is False]
    assert any(f"1 chunks of {path} cannot be read; `streetloom run" in line for line in findings)
    assert is_store_marked_suspect(out)
    if said is None:
        (out / SUSPECT).unlink()  # the run sees it without the doctor
    lines = repair_store(run)
    assert len(lines) == (said is not None)
    assert all(line.endswith(said or "") for line in lines)
    texture(textured[0], out)
    assert digests_of(out) == wanted
    assert {stage for stage, _ in redone(before, out)} == ({stage for stage, _ in before} if anew is None else anew)
    assert find_unreadable_chunks(open_repository(run.store).readonly_session(BRANCH)) == {}


def test_no_flipped_bit_of_a_chunk_is_taken_for_other_values(run: Run) -> None:
    path = "atlas/seed"
    wanted = _group(open_repository(run.store).readonly_session(BRANCH))[path][...]
    before = set((run.store / "chunks").iterdir())

    def write_again(group: Any) -> None:
        group[path][0] = wanted[0]

    changed(run.store, write_again)
    chunk = max(set((run.store / "chunks").iterdir()) - before, key=lambda file: file.stat().st_size)
    whole = chunk.read_bytes()
    for place in np.linspace(0, 0.999, 60):
        chunk.write_bytes(whole)
        flip_bit(chunk, place)
        with pytest.raises(RuntimeError, match="decompression error"):
            _group(open_repository(run.store).readonly_session(BRANCH))[path][...]
