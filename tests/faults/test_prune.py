"""What is pruned, and what is not: the current snapshot, what somebody reads, what the store stands on."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
import zarr
from click.testing import CliRunner

from catalogs.published.file_list import find_snapshot_damage
from catalogs.published.snapshot import SnapshotFolder, current_snapshot
from facade_core.atlas.integrity import has_all_files
from facade_core.atlas.store import BRANCH, commit, open_repository
from facade_core.core.errors import InputError
from flows.cli.commands import command_line
from flows.lock import lock_folder
from tasks.engine.run import Run
from tasks.engine.store.status import completion_summary
from tasks.history import after_viewpoint
from tasks.publish.prune import prune_snapshots
from tasks.publish.task import publish_block


def published_again(run: Run, block: Path) -> str:
    """The run's next snapshot, published: its store holds colours of before that no snapshot of now has."""
    repository = open_repository(run.store)
    session = repository.writable_session(BRANCH)
    group = zarr.open_group(session.store)
    held = group["atlas/colour"][0]
    group["atlas/colour"][0] = 255 - held
    commit(session, "of before")
    session = repository.writable_session(BRANCH)
    zarr.open_group(session.store)["atlas/colour"][0] = held
    commit(session, "as it was")
    session = repository.writable_session(BRANCH)  # the snapshot before the newest is never expired
    zarr.open_group(session.store).attrs["ingested"] = 1.0
    commit(session, "of now")
    with current_snapshot(Path(run.out)).hold_for_reading():  # so that publishing leaves the history
        publish_block.fn(run, block)
    return current_snapshot(Path(run.out)).id


def leads_to(folder: Path, name: str) -> list[str]:
    """The STAC files of a published folder that lead to another."""
    found = [path for path in (folder / "stac").rglob("*.json") if f"/{name}/" in path.read_text()]
    for path in (folder / "stac").glob("*/items.parquet"):
        table = pq.read_table(path)
        if f"/{name}/" in f"{table.to_pylist()} {table.schema.metadata}":
            found.append(path)
    return [path.relative_to(folder).as_posix() for path in found]


def test_older_snapshots_go_with_what_only_they_hold(textured: tuple[Path, Run], run: Run) -> None:
    out, block = Path(run.out), textured[0]
    first = current_snapshot(out).id
    second = published_again(run, block)
    published = out / "published"
    assert leads_to(published / second, first)
    read = "R" * 20
    shutil.copytree(published / first, published / read)
    for leftover in (published / ".KILLED.tmp", out / ".doctor-killed.tmp"):
        (leftover / "pages").mkdir(parents=True)
    for leftover in (out / ".current.tmp", out / ".seen-killed"):
        leftover.touch()
    repository, done = open_repository(run.store), completion_summary(run)
    assert done is not None
    newest = repository.lookup_branch(BRANCH)
    for tag in ("street-s1-0123456789ab", "handed over"):  # of a run of 0.1.0, and of a person
        repository.create_tag(tag, newest)
    size = sum(path.stat().st_size for path in (run.store / "chunks").iterdir())

    with SnapshotFolder(published / read).hold_for_reading():
        said = prune_snapshots(out, 1)
    assert "removed 1 published snapshots and 4 leftovers" in said[0]
    assert said[1:] == [f"{out}: kept {read}, which somebody reads"]
    assert sorted(path.name for path in published.iterdir()) == sorted([second, read])
    assert not [path for path in out.iterdir() if path.name.endswith(".tmp") or path.name.startswith(".seen")]
    assert repository.list_tags() == {"handed over"}
    assert leads_to(published / second, first) == []
    assert find_snapshot_damage(published / second, thorough=True) is None
    assert sum(path.stat().st_size for path in (run.store / "chunks").iterdir()) < size
    assert has_all_files(open_repository(run.store), run.store)
    assert after_viewpoint(out, "s1", 1).visible_charts()
    assert completion_summary(run) == done

    assert "removed 1 published snapshots and 0 leftovers" in prune_snapshots(out, 1)[0]
    assert [path.name for path in published.iterdir()] == [second]
    assert "removed 0 published" in prune_snapshots(out, 1)[0]
    assert completion_summary(run) == done
    links = json.loads((published / second / "stac" / "blocks" / "collection.json").read_text())["links"]
    assert not [link for link in links if "version" in link["rel"]]


@pytest.mark.parametrize("kill_at", [2, 15, 30])
def test_a_prune_that_is_killed_and_repeated_leaves_a_whole_snapshot(
    textured: tuple[Path, Run], run: Run, monkeypatch: pytest.MonkeyPatch, kill_at: int
) -> None:
    out, moved = Path(run.out), os.replace
    published_again(run, textured[0])
    calls = 0

    def kill(*paths: Any) -> None:
        nonlocal calls
        calls += 1
        if calls >= kill_at:
            raise SystemExit
        moved(*paths)

    monkeypatch.setattr(os, "replace", kill)
    with pytest.raises(SystemExit):
        prune_snapshots(out, 1)
    monkeypatch.setattr(os, "replace", moved)
    prune_snapshots(out, 1)
    assert find_snapshot_damage(current_snapshot(out).folder, thorough=True) is None
    assert not list((out / "published").rglob(".*.tmp"))


def test_what_is_kept_is_the_newest_and_a_run_prunes_too(textured: tuple[Path, Run], run: Run) -> None:
    out = Path(run.out)
    first = current_snapshot(out).id
    for name in ("A" * 20, "B" * 20):
        shutil.copytree(out / "published" / first, out / "published" / name)
    shown = CliRunner().invoke(command_line, ["run", str(textured[0]), "--out", run.out, "--keep", "2"])
    assert shown.exit_code == 0, shown.output
    assert "removed 1 published snapshots" in shown.output
    assert len(list((out / "published").iterdir())) == 2
    assert (out / "published" / first).is_dir()
    with lock_folder(out):  # by this process: a run of another is refused
        assert CliRunner().invoke(command_line, ["prune", run.out, "--keep", "0"]).exit_code == 2
    shown = CliRunner().invoke(command_line, ["prune", run.out, "--keep", "1"])
    assert "removed 1 published snapshots" in shown.output
    (out / "current").unlink()
    with pytest.raises(InputError, match="nothing is published; `streetloom run"):
        prune_snapshots(out, 1)
