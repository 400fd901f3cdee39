"""How a block's process ended is what is said of it, whichever way that was."""

from __future__ import annotations

import subprocess
import time
from pathlib import Path

import pytest

from tasks.city.block_process import MACHINE_EXIT_CODE, run_block
from tasks.city.city_log import BlockResult
from tasks.engine.commands import DEADLINE_EXIT_CODE, TERMINATION_TIMEOUT_S


def ended(folder: Path, ends: float | None = None) -> BlockResult:
    return run_block.fn(
        folder, "a", folder / "none.yaml", ["--workers", "1"], BlockResult(), "d", "v", ends, tiles=True
    )


def test_what_a_block_says_is_why_it_failed(tmp_path: Path) -> None:
    how = ended(tmp_path)
    assert how.code == 2
    assert "none.yaml" in how.reason
    assert (how.digest, how.version, how.snapshot, how.tiles) == ("d", "v", "", "")
    assert 0 < how.processor < 60


def test_a_block_that_cannot_be_run_stops_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*arguments: object, **options: object) -> None:
        raise OSError("no process more")

    monkeypatch.setattr(subprocess, "Popen", full)
    how = ended(tmp_path)
    assert (how.code, how.reason, how.digest) == (MACHINE_EXIT_CODE, "could not be run: no process more", "d")


def test_a_block_whose_time_is_up_is_ended(tmp_path: Path) -> None:
    begun = time.time()
    how = ended(tmp_path, begun + 0.05)
    assert how.code == DEADLINE_EXIT_CODE
    assert how.reason == "its time was up; finished work is kept"
    assert time.time() - begun < TERMINATION_TIMEOUT_S
