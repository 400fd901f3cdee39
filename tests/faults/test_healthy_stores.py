"""Healthy stores whose disk or bucket fails: nobody is told to remove one, no work is discarded, and the run goes on."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path

import icechunk
import pytest
import zarr
from click.testing import CliRunner

from benchmarks.s3_server import FAULTS
from catalogs.published.s3 import S3Path
from facade_core.atlas import integrity
from facade_core.atlas.store import BRANCH, commit, create_root, open_repository
from facade_core.core.errors import LostStoreError, MachineError
from flows.cli.commands import command_line
from flows.cli.exit_codes import EXIT_UNAVAILABLE, exit_code_and_message
from tasks.engine.run import Run
from tasks.engine.store.integrity import mark_store_suspect, repair_store
from tests.bucket import served
from tests.pipeline.stages import digests_of


@pytest.fixture(scope="module")
def bucket(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[S3Path, Path]]:
    """A bucket, and the file that names the request which it answers badly."""
    faults = tmp_path_factory.mktemp("bucket") / "faults.json"
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv(FAULTS, str(faults))
        with served("faults") as address:
            yield S3Path(address.removeprefix("s3://")), faults


@pytest.mark.parametrize("lost", ["/refs/", "/snapshots/", "/transactions/", "/manifests/"])
@pytest.mark.parametrize("when", ["created", "committed"])
def test_a_commit_whose_answer_is_lost_stands(bucket: tuple[S3Path, Path], lost: str, when: str) -> None:
    folder, faults = bucket
    store = folder / f"{when}{lost.replace('/', '-')}" / "store"
    if when == "created":
        faults.write_text(json.dumps(["PUT", lost, "lose"]))
    repository = open_repository(store, create=True)
    session = repository.writable_session(BRANCH)
    create_root(session).create_array("x", shape=(4,), chunks=(1,), dtype="i4")
    commit(session, "first")
    for value in (1, 2):
        session = repository.writable_session(BRANCH)
        zarr.open_group(session.store)["x"][0] = value
        if when == "committed":
            faults.write_text(json.dumps(["PUT", lost, "lose"]))
        assert commit(session, f"value {value}") == repository.lookup_branch(BRANCH)
        assert not faults.exists() or when == "created"
    faults.unlink(missing_ok=True)
    history = [snapshot.message for snapshot in repository.ancestry(branch=BRANCH)]
    assert history == ["value 2", "value 1", "first", "Repository initialized"]
    assert zarr.open_group(repository.readonly_session(BRANCH).store, mode="r")["x"][0] == 2


@pytest.mark.parametrize("size", ["4k", "8k", "12k", "16k"])
def test_a_disk_that_is_full_at_creation_is_no_reason_to_remove_a_store(tmp_path: Path, size: str) -> None:
    def begin() -> str:
        session = open_repository(tmp_path / "store", create=True).writable_session(BRANCH)
        create_root(session)
        return commit(session, "first")

    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", tmp_path], capture_output=True)
    if mounted.returncode:
        pytest.skip(f"no disk of a size can be mounted here: {mounted.stderr.decode().strip()}")
    try:
        with pytest.raises(Exception, match="No space left on device") as full:
            begin()
        assert "remove" not in str(full.value)
        subprocess.run(["mount", "-o", "remount,size=1m", tmp_path], check=True)
        integrity.roll_back_to_readable(tmp_path / "store", lambda session: None)
        assert begin()
    finally:
        subprocess.run(["umount", "-l", tmp_path], check=True)


def test_files_that_the_disk_refuses_are_not_damaged(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    wanted, read, refused = digests_of(Path(run.out)), Path.read_bytes, [True]

    def refuse(path: Path) -> bytes:
        if refused and path.parent.name == "snapshots":
            raise PermissionError(13, "Permission denied", str(path))
        return read(path)

    def verify(session: object) -> None:
        if refused:
            raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "read_bytes", refuse)
    with pytest.raises(
        MachineError, match=r"snapshots/\w+: cannot be read \(Permission denied\); see to its permissions"
    ):
        integrity.roll_back_to_readable(run.store, verify)
    monkeypatch.setattr("tasks.engine.store.integrity.find_unreadable_chunks", lambda session: {"atlas/colour": None})
    mark_store_suspect(run.folder)
    with pytest.raises(MachineError, match="finished work is kept"):
        repair_store(run)
    refused.clear()
    monkeypatch.undo()
    assert integrity.roll_back_to_readable(run.store, verify) is None
    assert repair_store(run) == []
    assert digests_of(Path(run.out)) == wanted


def test_a_damaged_reference_is_told_with_what_judges_it(run: Run) -> None:
    (run.store / "refs" / f"branch.{BRANCH}" / "ref.json").write_text("{")
    with pytest.raises(LostStoreError, match=r"cannot be opened \(.*\); see to its disk.*`streetloom doctor .*` says"):
        open_repository(run.store)


@pytest.mark.parametrize("method", ["GET", "PUT"])
def test_a_bucket_that_answers_with_500_is_unavailable(bucket: tuple[S3Path, Path], method: str) -> None:
    folder, faults = bucket
    store = folder / f"unavailable-{method}" / "store"
    session = open_repository(store, create=True).writable_session(BRANCH)
    create_root(session)
    commit(session, "first")
    session = open_repository(store).writable_session(BRANCH)
    zarr.open_group(session.store).attrs["value"] = 1

    def use() -> None:
        if method == "GET":
            open_repository(store)
        commit(session, "second")

    faults.write_text(json.dumps([method, f"unavailable-{method}", "500"]))
    try:
        with pytest.raises(Exception, match=r"service error|does not answer") as raised:
            use()
    finally:
        faults.unlink()
    code, message = exit_code_and_message(raised.value)
    assert code == EXIT_UNAVAILABLE
    assert "finished work is kept" in message
    assert "remove" not in message


def test_a_clock_that_was_set_back_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    session = open_repository(tmp_path / "store", create=True).writable_session(BRANCH)
    create_root(session)

    def refuse(*_: object, **__: object) -> str:
        raise icechunk.IcechunkError(
            "session error: invalid snapshot timestamp ordering. parent: `2026-11-30 10:00`, child: `2026-11-29 10:00`\n |"
        )

    monkeypatch.setattr(icechunk.Session, "commit", refuse)
    with pytest.raises(
        MachineError, match=r"the clock .* is behind the last commit \(parent: .*29 10:00`\); set the clock"
    ):
        commit(session, "first")


def test_metrics_leave_out_a_run_before_its_first_commit(run: Run, tmp_path: Path) -> None:
    open_repository(tmp_path / "begun" / "store", create=True)
    (tmp_path / "empty" / "store").mkdir(parents=True)
    said = CliRunner().invoke(command_line, ["metrics", str(tmp_path)])
    assert said.exit_code == 0
    assert 'streetloom_published{run="out"} 1.0' in said.stdout
    assert "streetloom: begun is left out" in said.stderr
    assert "streetloom: empty is left out" in said.stderr
