"""SIGKILL at different moments and the run again: the same atlas as an undisturbed run."""

from __future__ import annotations

import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest

from facade_core.errors import StoreError
from tasks.commits import journal
from tests.pipeline.runs import ROOT, command, environment, run

# (stage, how many of its units are journalled when the run is killed)
MOMENTS = (("exemplars", 0), ("facades", 1), ("viewpoints", 1), ("viewpoints", 7), ("streets", 1))


def done(store: Path, stage: str) -> int:
    try:
        return sum(record is not None for record in journal(store, stage))
    except (StoreError, KeyError, FileNotFoundError):
        return -1  # not there yet


@pytest.mark.parametrize(("workers", "moments"), [(1, MOMENTS[1::2]), (2, MOMENTS)])
def test_killed_again_and_again(
    block: Path,
    undisturbed: tuple[Path, dict[str, Any]],
    tmp_path: Path,
    workers: int,
    moments: tuple[tuple[str, int], ...],
) -> None:
    """Each run is killed once its moment is reached; the last is left to finish."""
    out = tmp_path / "out"
    kills = 0
    for stage, count in moments:
        process = subprocess.Popen(
            command(block, out, workers),
            cwd=ROOT,
            env=environment(tmp_path),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        deadline = time.monotonic() + 300
        while process.poll() is None and done(out / "store", stage) < count and time.monotonic() < deadline:
            time.sleep(0.2)
        if process.poll() is None:
            process.send_signal(signal.SIGKILL)
            kills += 1
        process.wait()
    assert kills == len(moments)
    finished = run(block, out, workers=workers)
    assert finished["units_skipped"] > 0
    assert finished["atlas_digest"] == undisturbed[1]["atlas_digest"]
