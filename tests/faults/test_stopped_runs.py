"""Runs whose processes are stopped and go on, and Ctrl-C at random moments: the same atlas, and nothing left.

STREETLOOM_INTERRUPTS says how often Ctrl-C comes.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import time
from pathlib import Path

import psutil
import pytest

from tests.faults.test_killed_at_random import left_over
from tests.pipeline.runs import PATIENCE_S, ROOT, command, environment, run
from tests.pipeline.stages import BUILDINGS, STREETS, digests_of, texture, write_block

INTERRUPTS = int(os.environ.get("STREETLOOM_INTERRUPTS", "2"))
# Seconds that each process is stopped: longer than what polls it waits, shorter than what gives it up.
STOP_S = 2.0

pytestmark = [pytest.mark.long, pytest.mark.timeout(1800 + 120 * INTERRUPTS)]


def start(block: Path, out: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        command(block, out, 2),
        cwd=ROOT,
        env=environment(out.parent) | {"TMPDIR": str(out.parent / "tmp")},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def wait_for_workers(process: subprocess.Popen[str]) -> None:
    """Wait until a run has its server's processes, a tracker and two workers."""
    deadline = time.monotonic() + PATIENCE_S
    while process.poll() is None and time.monotonic() < deadline:
        if len(psutil.Process(process.pid).children(recursive=True)) >= 5:
            return
        time.sleep(0.05)
    assert process.poll() is None, process.communicate()[1]


def stop_each(process: subprocess.Popen[str]) -> int:
    """Stop each process of a run for a while, one after the other; returns how many there were."""
    family = [psutil.Process(process.pid), *psutil.Process(process.pid).children(recursive=True)]
    stopped = 0
    for one in family:
        try:
            one.suspend()
            time.sleep(STOP_S)
            one.resume()
            stopped += 1
        except psutil.NoSuchProcess:
            continue
    return stopped


def test_each_process_stopped_and_interrupted_at_random_moments(tmp_path: Path) -> None:
    buildings, streets = {name: BUILDINGS[name] for name in "ab"}, {"1": STREETS["1"]}
    block = write_block(tmp_path / "in", buildings=buildings, streets=streets, texture={"walls": "translate"})
    texture(block, tmp_path / "whole" / "out")
    whole, _ = digests_of(tmp_path / "whole" / "out")

    out = tmp_path / "stopped" / "out"
    (out.parent / "tmp").mkdir(parents=True)
    begun, process = time.monotonic(), start(block, out)
    wait_for_workers(process)
    stopped = stop_each(process)
    assert stopped >= 4, "the run, the guard, the server and a worker"
    said = process.communicate(timeout=PATIENCE_S)[1]
    length = time.monotonic() - begun - stopped * STOP_S
    assert process.returncode == 0, said
    assert left_over(out) == []

    draw, out = random.Random(4), tmp_path / "interrupted" / "out"
    (out.parent / "tmp").mkdir(parents=True)
    for _ in range(INTERRUPTS):
        process = start(block, out)
        time.sleep(draw.uniform(0.2, 0.9) * length)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal's Ctrl-C does
        said = process.communicate(timeout=PATIENCE_S)[1]
        assert process.returncode in (0, 128 + signal.SIGINT), said
        assert "Traceback" not in said, said
    done = run(block, out)
    assert done["atlas_digest"] == whole
    assert left_over(out) == []
    assert digests_of(tmp_path / "stopped" / "out")[0] == whole
    assert [path.name for path in (out.parent / "tmp").iterdir() if path.name.startswith("streetloom")] == []
