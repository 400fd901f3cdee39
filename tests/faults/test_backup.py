"""A store that is copied by the lines of deploy/README.md while a run commits, and restored."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import icechunk
import numpy as np
import pytest
import zarr

from facade_core.atlas.store import open_repository
from tests.pipeline.runs import ROOT

README = (ROOT / "deploy" / "README.md").read_text().splitlines()
REFS, REST = (
    next(line for line in README if line.startswith(start)) for start in ("mkdir -p backup", "cp -a out/mine/store/[")
)


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """A folder `out/mine` whose store has one commit of ones."""
    folder = tmp_path / "out" / "mine"
    folder.mkdir(parents=True)
    icechunk.Repository.create(icechunk.local_filesystem_storage(str(folder / "store")))
    commit(folder, 1)
    return folder


def commit(out: Path, value: int) -> None:
    session = open_repository(out / "store").writable_session("main")
    array = zarr.group(session.store, overwrite=False).require_array("a", shape=(64, 64), chunks=(16, 16), dtype="u1")
    array[:] = value
    session.commit(f"all {value}")


def typed(line: str, folder: Path) -> None:
    subprocess.run(["sh", "-c", line.split("  #")[0]], cwd=folder, check=True)


def restored(folder: Path) -> np.ndarray:
    session = open_repository(folder / "backup" / "store").readonly_session("main")
    return zarr.open_array(session.store, path="a", mode="r")[:]


def test_what_is_copied_by_the_readme_opens_whatever_is_committed_meanwhile(out: Path) -> None:
    folder = out.parent.parent
    typed(REFS, folder)
    commit(out, 2)
    typed(REST, folder)
    assert (restored(folder) == 1).all()  # of before the copy began, and whole
    back = folder / "again"
    (folder / "backup").rename(back)
    commit(back, 3)  # a run goes on from it
    session = open_repository(back / "store").readonly_session("main")
    assert (zarr.open_array(session.store, path="a", mode="r")[:] == 3).all()


def test_in_the_other_order_it_does_not(out: Path) -> None:
    """Why the order is told: a ref that is copied last may name a snapshot that the copy lacks."""
    folder = out.parent.parent
    refs_last: list[Callable[[], None]] = [
        lambda: typed(f"mkdir -p backup/store && {REST}", folder),
        lambda: commit(out, 2),
        lambda: typed(REFS, folder),
    ]
    for step in refs_last:
        step()
    with pytest.raises(Exception, match=r"(?i)snapshot|not found|object"):
        restored(folder)
