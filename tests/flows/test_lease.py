"""The lock of a run in a bucket: who has it, for how long, and who may take it over."""

from __future__ import annotations

import json
import os
import re
import time
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest

from catalogs.published import object_store
from catalogs.published.folders import local_run_folder
from catalogs.published.s3 import S3Path
from facade_core.atlas.arrays import STORE_FORMAT
from facade_core.atlas.store import BRANCH, commit, open_repository, open_root
from facade_core.core.errors import InputError, MachineError
from flows import lease as leases
from flows.lock import is_locked, lock_folder
from tests.bucket import served


@pytest.fixture(scope="module")
def bucket() -> Iterator[str]:
    with served("locks") as address:
        yield address


@pytest.fixture
def out(bucket: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> S3Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "here"))
    return S3Path(f"locks/{tmp_path.name}")


def elsewhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """As if on another machine: nothing there knows what this one held."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "there"))


def leave(out: S3Path, until: float) -> None:
    """The lock of a process on another machine, which lasts until then."""
    at = datetime.fromtimestamp(until, UTC).isoformat()
    (out / ".lock").write_text(json.dumps({"host": "far", "pid": 7, "run": "abcdefgh1", "until": at}))


def test_a_second_run_is_told_who_is_there_and_until_when(out: S3Path) -> None:
    leave(out, time.time() + 3600)
    with pytest.raises(InputError) as refused, lock_folder(out):
        pass
    said = str(refused.value)
    assert re.search(r"process 7 on 'far' \(run abcdefgh\), whose lock lasts until \d\d:\d\d:\d\d UTC", said), said
    assert is_locked(out)


def test_a_lock_that_is_over_is_taken_over_and_given_back(out: S3Path) -> None:
    leave(out, time.time() - 1)
    assert not is_locked(out)
    with lock_folder(out), lock_folder(out):  # it may be nested
        held = json.loads((out / ".lock").read_text())
        assert held["pid"] == os.getpid()
        assert is_locked(out)
    assert not is_locked(out)
    assert object_store.download_object(f"{out.path}/.lock") is None


def test_a_process_that_ended_on_this_machine_is_not_waited_for(
    out: S3Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with lock_folder(out):
        left = (out / ".lock").read_text()
    (out / ".lock").write_text(left)  # as it is after SIGKILL
    elsewhere(monkeypatch, tmp_path)
    with pytest.raises(InputError, match="another run is at work in it"), lock_folder(out):
        pass
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "here"))
    with lock_folder(out):
        assert json.loads((out / ".lock").read_text())["run"] != json.loads(left)["run"]


def test_a_bucket_that_keeps_no_conditions_is_refused(out: S3Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def overwrite(path: str, data: bytes, tag: str | None) -> str:
        object_store.upload_object(path, data)
        return '"tag"'

    monkeypatch.setattr(object_store, "upload_if_unchanged", overwrite)
    with pytest.raises(InputError, match="keeps no conditions on writing"), lock_folder(out):
        pass
    assert not is_locked(out)


def test_it_is_renewed_as_long_as_the_run_goes_on(out: S3Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(leases, "RENEWAL_S", 0.05)
    with lock_folder(out):
        first = json.loads((out / ".lock").read_text())["until"]
        deadline = time.monotonic() + 300
        while json.loads((out / ".lock").read_text())["until"] == first:
            assert time.monotonic() < deadline, "it was never renewed"
            time.sleep(0.02)


def test_who_lost_it_commits_nothing(out: S3Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(leases, "RENEWAL_S", 0.05)
    store = out / "store"
    with lock_folder(out):
        open_repository(store, create=True)
        session = open_repository(store).writable_session(BRANCH)
        open_root(session).attrs.update(format=STORE_FORMAT, by="the first")
        commit(session, "while it is held")
        session = open_repository(store).writable_session(BRANCH)
        open_root(session).attrs["by"] = "a late one"
        leave(out, time.time() + 3600)  # as another run does that found it over: this process slept for so long
        deadline = time.monotonic() + 300
        while True:
            try:
                leases_still(out)
            except MachineError:
                break
            assert time.monotonic() < deadline, "it was not noticed"
            time.sleep(0.05)
        with pytest.raises(MachineError, match=r"process 7 on 'far' .* took its lock over"):
            commit(session, "too late")
    assert dict(open_root(open_repository(store).readonly_session(BRANCH)).attrs)["by"] == "the first"
    assert json.loads((out / ".lock").read_text())["host"] == "far", "the lock of another run is not removed"


def leases_still(out: S3Path) -> None:
    """What a commit asks."""
    from facade_core.atlas import store

    store._commit_guards[out / "store"]()


def test_who_could_not_renew_it_in_time_commits_nothing(out: S3Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with lock_folder(out):
        leases_still(out)
        monkeypatch.setattr(leases, "LEASE_S", leases.CLOCK_MARGIN_S)  # as if it were nearly over
        with pytest.raises(MachineError, match="could not be renewed in time"):
            leases_still(out)


def test_two_on_one_machine(out: S3Path) -> None:
    """The file of the local side is held as a folder's is."""
    import fcntl

    local = local_run_folder(out)
    local.mkdir(parents=True)
    with (local / ".lock").open("w") as handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        with pytest.raises(InputError, match="another run is at work in it"), lock_folder(out):
            pass
