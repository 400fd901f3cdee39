"""Ctrl-C, or an end by the system, while a library computes and Python calls no handler."""

from __future__ import annotations

import os
import pty
import signal
import subprocess
import sys
import time

import pytest

from tests.pipeline.runs import ROOT

ENDLESS = """
import sqlite3
from flows.cli.interrupts import {name}
{start}
    print("begun", flush=True)
    sqlite3.connect(":memory:").execute(
        "WITH RECURSIVE r(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM r) SELECT count(*) FROM r").fetchall()
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    ("name", "start"),
    [("exit_on_signal", "exit_on_signal()\nif True:"), ("unwind_on_signal", "with unwind_on_signal():")],
)
def test_ends_at_once_with_one_line(number: signal.Signals, name: str, start: str) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", ENDLESS.format(name=name, start=start)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "begun\n"
    time.sleep(0.2)
    process.send_signal(number)
    begun = time.monotonic()
    _, wrong = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    assert time.monotonic() - begun < 30
    assert wrong.strip() == "streetloom: interrupted; finished work is kept, run the same command to go on"


def test_a_terminal_gets_its_cursor_back() -> None:
    controller, terminal = pty.openpty()
    code = ENDLESS.format(name="exit_on_signal", start="exit_on_signal()\nif True:")
    process = subprocess.Popen(
        [sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.PIPE, stderr=terminal, text=True
    )
    os.close(terminal)
    assert process.stdout is not None
    assert process.stdout.readline() == "begun\n"
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=60) == 128 + signal.SIGINT
    assert b"\x1b[?25h" in os.read(controller, 1000)
    os.close(controller)
    process.stdout.close()
