"""Command line in a process of its own: its deadline, its output, and the newest line while it runs."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from tasks.engine.child_processes import end_with_parent

# Exit code of sysexits.h for failures that another try may not have; a command whose time is up has it.
DEADLINE_EXIT_CODE = 75
# Seconds between SIGTERM and SIGKILL; commits are atomic, so a block ends quickly.
TERMINATION_TIMEOUT_S = 30.0


@dataclass(frozen=True)
class CommandResult:
    """Result of a command line.

    Attributes
    ----------
    code : exit code.
    last_line : last line of stderr.
    output : stdout.
    processor_s : processor seconds of the process and of all children that it waited for.
    """

    code: int
    last_line: str
    output: str
    processor_s: float


def run_command(arguments: Sequence[str], ends: float | None, errors: Path) -> CommandResult:
    """Run the command line with some arguments until it ends or its deadline passes.

    Parameters
    ----------
    arguments : arguments of `streetloom`.
    ends : Unix time at which the process is terminated; None: no limit.
    errors : file for its stderr; `read_newest_line` shows how far it is.
    """
    with tempfile.TemporaryFile() as printed, errors.open("w+b") as said:
        process = subprocess.Popen(
            [sys.executable, "-m", "flows", *arguments],
            stdin=subprocess.DEVNULL,
            stdout=printed,
            stderr=said,
            preexec_fn=end_with_parent,  # it must not outlive the thread that waits for it
        )
        handle = os.pidfd_open(process.pid)
        try:
            in_time = _has_ended(handle, None if ends is None else max(ends - time.time(), 0.0))
            if not in_time:
                signal.pidfd_send_signal(handle, signal.SIGTERM)
                if not _has_ended(handle, TERMINATION_TIMEOUT_S):
                    signal.pidfd_send_signal(handle, signal.SIGKILL)
            _, status, used = os.wait4(process.pid, 0)
        finally:
            os.close(handle)
        code = process.returncode = os.waitstatus_to_exitcode(status)
        output, lines = (
            _read_text(printed),
            [line.removeprefix("streetloom: ") for line in _read_text(said).strip().splitlines()],
        )
    processor = used.ru_utime + used.ru_stime
    if not in_time:
        return CommandResult(DEADLINE_EXIT_CODE, "its time was up; finished work is kept", output, processor)
    return CommandResult(code if code >= 0 else 128 - code, lines[-1] if lines else "", output, processor)


def _has_ended(handle: int, seconds: float | None) -> bool:
    """Wait for a process for some seconds; None: without limit."""
    return bool(select.select([handle], [], [], seconds)[0])


def _read_text(file: IO[bytes]) -> str:
    file.seek(0)
    return file.read().decode(errors="replace")


def read_newest_line(path: Path) -> str:
    """Return the last line that a running command printed on stderr; empty before the first."""
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").strip().splitlines()
    except OSError:
        return ""
    return lines[-1].removeprefix("streetloom: ") if lines else ""
