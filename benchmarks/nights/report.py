"""What a night left: state of the run, lines of its logs, alarms, metrics and bytes."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from prometheus_client.parser import text_string_to_metric_families

from benchmarks.nights.clock import ZONE

if TYPE_CHECKING:
    from prefect.client.schemas.objects import FlowRun

    from tests.pipeline.deployed import Site

# Prefix of a run's lines in the worker's log.
PRINTED = "streetloom: "
# Logger of the lines that close a stage, and the units in them.
STAGE_LOGGER = "flows.block"
STAGE_UNITS = re.compile(r"(\d+) done, (\d+) done before, (\d+) failed")


class NightStart:
    """What was there when a night began, so that the rest can be told as the night's own."""

    def __init__(self, out: Path, home: Path, alarms: int) -> None:
        self._out = out
        self._home = home
        self._alarms = alarms
        self._logs = {*out.glob("logs/*.jsonl")}
        self._printed = len(_read_worker_lines(home))

    def describe_night(
        self, site: Site, run: FlowRun, alarms: Sequence[tuple[datetime, dict[str, str]]]
    ) -> dict[str, Any]:
        """Describe the night whose run has ended.

        Parameters
        ----------
        site : Prefect server with its worker.
        run : the night's run.
        alarms : all notifications so far, with the time at which they came.
        """
        assert run.state
        assert run.start_time
        assert run.end_time
        current = self._out / "current"
        log = [line for path in sorted({*self._out.glob("logs/*.jsonl")} - self._logs) for line in _read_log(path)]
        return {
            "run": {
                "due": _format_time(run.expected_start_time),
                "state": run.state.name,
                "message": run.state.message,
                "tries": run.run_count,
                "ended": _format_time(run.end_time),
                "seconds": round((run.end_time - run.start_time).total_seconds()),
            },
            "printed": _read_worker_lines(self._home)[self._printed :],
            "log": log,
            "units": count_units(log),
            "alarms": [
                {"time": _format_time(when), "subject": told["subject"], "message": told["body"].splitlines()[0]}
                for when, told in alarms[self._alarms :]
            ],
            "metrics": read_metrics(site, self._out),
            "store_mb": measure_folder_mb(self._out / "store"),
            "published_mb": measure_folder_mb(self._out / "published"),
            "published": len([path for path in self._out.glob("published/*") if path.is_dir()]),
            "current": current.read_text().strip() if current.is_file() else None,
        }


def count_units(log: Sequence[str]) -> dict[str, int]:
    """Count the units done, done before and failed by the lines that close the stages of a run."""
    found = [match for line in log if (match := STAGE_UNITS.search(line))]
    return {name: sum(int(match[place]) for match in found) for place, name in enumerate(("done", "kept", "failed"), 1)}


def read_metrics(site: Site, out: Path) -> dict[str, Any]:
    """Read what `streetloom metrics` prints of a run, units counted by state."""
    done = subprocess.run(
        [sys.executable, "-m", "flows", "metrics", str(out)],
        cwd=site.root,
        env=site.environment,
        capture_output=True,
        text=True,
        check=True,
    )
    units: Counter[str] = Counter()
    found: dict[str, Any] = {}
    for family in text_string_to_metric_families(done.stdout):
        for sample in family.samples:
            if sample.name == "streetloom_units":
                units[sample.labels["state"]] += int(sample.value)
            elif sample.name == "streetloom_unit_latest":
                found[sample.name] = _format_time(datetime.fromtimestamp(sample.value, ZONE))
            elif sample.name != "streetloom_unit_seconds":
                found[sample.name] = int(sample.value)
    return {"streetloom_units": dict(sorted(units.items()))} | found


def measure_folder_mb(folder: Path) -> float:
    """Measure the files of a folder, MB of 1e6 bytes; files of several names count once."""
    found = (path.stat() for path in folder.rglob("*") if path.is_file())
    return round(sum({stat.st_ino: stat.st_size for stat in found}.values()) / 1e6, 2)


def _read_worker_lines(home: Path) -> list[str]:
    """Read the lines that runs printed, without the name of the program."""
    return [
        line.strip().removeprefix(PRINTED)
        for log in sorted(home.glob("worker*.log"))
        for line in log.read_text(errors="replace").splitlines()
        if line.strip().startswith(PRINTED)
    ]


def _read_log(path: Path) -> list[str]:
    """Read the warnings and errors of a run's log, and the lines that close its stages."""
    records = [json.loads(line) for line in path.read_text().splitlines()]
    return [
        f"{record['level']}: {record['message']}"
        for record in records
        if record["level"] in ("warning", "error") or record["logger"] == STAGE_LOGGER
    ]


def _format_time(moment: datetime | None) -> str | None:
    """Format a time in the zone of the schedule."""
    return None if moment is None else f"{moment.astimezone(ZONE):%d %b %H:%M:%S}"
