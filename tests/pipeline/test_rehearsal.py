"""The short form of the rehearsal of a deployment: one block, every part in a network namespace of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from deploy.rehearsal import namespaces, postgres
from tests.pipeline.runs import ROOT, environment

pytestmark = [pytest.mark.long, pytest.mark.timeout(2400)]


def test_a_block_ends_as_without_faults_after_all_that_happens_to_its_cluster(tmp_path: Path) -> None:
    """A worker is cut off for a while, one killed, one of other code, and the scheduler killed."""
    if reason := namespaces.unfit() or postgres.unfit():
        pytest.skip(reason)
    short = ["--blocks", "1", "--cut", "10", "--no-bucket", "--folder", str(tmp_path / "all")]
    done = subprocess.run(
        [sys.executable, "-m", "deploy.rehearsal", *short],
        cwd=ROOT,
        env=environment(tmp_path),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    said = done.stdout
    for happened in (
        "worker1 is cut off",
        "worker2 is killed",
        "it is not used",
        "worker1 is back",
        "the scheduler is killed",
    ):
        assert happened in said
    found = json.loads(said.strip().splitlines()[-1])
    assert found["same"]
    assert found["facades"] > 0
    assert found["runs"] >= 2  # of the city, which was run twice, and of its block
    assert not _left(tmp_path)


def _left(folder: Path) -> list[str]:
    """The processes that were started with the rehearsal's folder among their words."""
    found = []
    for words in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            said = words.read_bytes().replace(b"\0", b" ").decode(errors="replace")
        except OSError:
            continue
        if str(folder) in said:
            found.append(said)
    return found
