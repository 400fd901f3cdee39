"""Ctrl-C, or an end by the system, while a command still imports what it needs: one line, 128 + signal, no traceback."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.pipeline.runs import ROOT, environment


def heeds(process: subprocess.Popen, number: int) -> bool:
    """Whether a process has a handler of its own for a signal."""
    (caught,) = [
        line for line in Path(f"/proc/{process.pid}/status").read_text().splitlines() if line.startswith("SigCgt")
    ]
    return bool(int(caught.split()[1], 16) >> (number - 1) & 1)


@pytest.mark.parametrize(("number", "after"), [(signal.SIGINT, 0.0), (signal.SIGINT, 0.5), (signal.SIGTERM, 0.0)])
def test_interrupted_while_it_imports(tmp_path: Path, number: signal.Signals, after: float) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "flows", "demo", "--out", str(tmp_path / "out")],
        cwd=ROOT,
        env=environment(tmp_path),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 300
    while not heeds(process, signal.SIGTERM) and time.monotonic() < deadline:  # Python has its own for SIGINT before
        time.sleep(0.01)
    time.sleep(after)
    process.send_signal(number)
    said, wrong = process.communicate(timeout=300)
    assert process.returncode == 128 + number
    assert said == ""
    assert wrong.strip() == "streetloom: interrupted; run the same command again", "nothing is done yet"
