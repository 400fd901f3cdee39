"""Run of the pending units of the viewer's block: the user's command in a child process."""

from __future__ import annotations

import json
import subprocess
import tempfile
import threading
from contextlib import suppress
from pathlib import Path

from catalogs.printable_text import format_count
from catalogs.published.folders import Folder
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject
from flows.lock import is_locked
from tasks.engine.commands import read_newest_line, run_command


class BackgroundRun:
    """Child process with `streetloom run` of a block into the viewer's folder, one at a time."""

    def __init__(self, out: Folder) -> None:
        self.out = out
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._last_line, self._failed = "", False
        self._errors: Path | None = None

    def start(self, block: Path) -> None:
        """Start the run.

        Raises
        ------
        InputError
            A run is in progress in the folder.
        """
        with self._lock:
            if self._is_running or is_locked(self.out):
                raise InputError("a run is at work in this folder already; wait for it")
            self._last_line, self._failed = "the run begins", False
            self._thread = threading.Thread(target=self._run, args=(block,), daemon=True, name="redo")
            self._thread.start()

    def status(self) -> JsonObject:
        """Return whether the run is in progress, its last line, and whether it failed."""
        errors = self._errors
        last_line = read_newest_line(errors) if errors else ""
        return {"under_way": self._is_running, "said": last_line or self._last_line, "failed": self._failed}

    @property
    def _is_running(self) -> bool:
        return self._thread is not None and self._thread.is_alive()

    def _run(self, block: Path) -> None:
        # This thread starts the process and lives as long: the end of the viewer ends the run; its commits are kept.
        with tempfile.TemporaryDirectory() as folder:
            self._errors = Path(folder) / "errors.txt"
            try:
                command = run_command(["run", str(block), "--out", str(self.out), "--json"], None, self._errors)
                self._last_line, self._failed = command.last_line or self._last_line, command.code != 0
                with suppress(LookupError, ValueError, TypeError):  # the run ended early; its last line has the reason
                    self._last_line = describe_outcome(json.loads(command.output.strip().splitlines()[-1]))
            except (OSError, subprocess.SubprocessError) as error:
                self._last_line, self._failed = f"the run could not be started: {error}", True
            finally:
                self._errors = None


def describe_outcome(summary: JsonObject) -> str:
    """Return the outcome of a run in one line."""
    counts = f"{format_count(summary['units_done'], 'unit')} done, {summary['units_skipped']} were done before"
    if not (summary["units_done"] or summary["failures"]):
        counts = f"there is nothing to do: all {summary['units_skipped']} units were done before"
    for key, word in (("failures", "failed"), ("refused", "refused")):
        if found := summary[key]:
            more = f"; and {len(found) - 1} more" if len(found) > 1 else ""
            counts += f"; {word} {found[0]['unit']}: {found[0]['reason']}{more}"
    return counts
