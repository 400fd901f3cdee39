"""Doing again what is due, out of the viewer: the command that a user would type, in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

from catalogs.published.folders import Folder
from facade_core.core.errors import InputError
from flows.lock import is_locked
from tasks.engine.compute.child_processes import end_with_parent


class BackgroundRun:
    """`streetloom run` of a block into the folder that the viewer shows, one at a time: the run's lock sees to that."""

    def __init__(self, out: Folder) -> None:
        self.out = out
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._said, self._failed = "", False

    def start(self, block: Path) -> None:
        """Begin, unless a run is at work in the folder, which raises InputError."""
        with self._lock:
            if self._going or is_locked(self.out):
                raise InputError("a run is at work in this folder already; wait for it")
            self._said, self._failed = "the run begins", False
            self._thread = threading.Thread(target=self._run, args=(block,), daemon=True, name="redo")
            self._thread.start()

    def said(self) -> dict[str, Any]:
        """Whether it goes on, the last line that it said, and whether it failed."""
        return {"under_way": self._going, "said": self._said, "failed": self._failed}

    @property
    def _going(self) -> bool:
        return self._thread is not None and self._thread.is_alive()

    def _run(self, block: Path) -> None:
        # Started by this thread, which lives as long as the run: the viewer's end ends it, and what is done is kept.
        with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as printed:
            try:
                process = subprocess.Popen(
                    [sys.executable, "-m", "flows", "run", str(block), "--out", str(self.out), "--json"],
                    stdin=subprocess.DEVNULL,
                    stdout=printed,
                    stderr=subprocess.PIPE,
                    text=True,
                    errors="replace",
                    preexec_fn=end_with_parent,
                )
            except (OSError, subprocess.SubprocessError) as error:
                self._said, self._failed = f"the run could not be started: {error}", True
                return
            assert process.stderr is not None
            with process.stderr as lines:
                for line in lines:
                    if line.strip():
                        self._said = line.strip().removeprefix("streetloom: ")
            self._failed = process.wait() != 0
            printed.seek(0)
            with suppress(LookupError, ValueError, TypeError):  # it ended early; what it said last tells why
                self._said = describe_outcome(json.loads(printed.read().strip().splitlines()[-1]))


def describe_outcome(summary: dict[str, Any]) -> str:
    """What a run came to, in a line."""
    counted = f"{summary['units_done']} units done, {summary['units_skipped']} were done before"
    failures = summary["failures"]
    if not failures:
        if summary["units_done"]:
            return counted
        return f"there is nothing to do: all {summary['units_skipped']} units were done before"
    first, more = failures[0], len(failures) - 1
    return f"{counted}; {first['unit']}: {first['reason']}{f'; and {more} more' if more else ''}"
