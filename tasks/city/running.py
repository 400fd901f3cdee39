"""One block of a city, run by the command line in a process of its own: what ends it ends nothing else."""

from __future__ import annotations

import ctypes
import json
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from prefect import task
from prefect.cache_policies import NO_CACHE

from catalogs.published.snapshot import current_if_any
from tasks.city.account import BLOCKS, Ended
from tasks.city.over import OF_BLOCK

# How a block ends, by sysexits.h, whose time is up: it is run again.
TIME_IS_UP = 75
# A block whose time is up has so long to end, seconds: it ends at once, as every unit is committed whole.
PATIENCE_S = 30.0
# Of a block's summary, what says nothing of what was made.
_LEFT_OUT = ("outputs", "failures", "out", "seconds")


@task(name="block", task_run_name="block {name}", cache_policy=NO_CACHE)
def run_block(
    out: Path,
    name: str,
    block_file: Path,
    options: Sequence[str],
    digest: str,
    version: str,
    ends: float | None,
    tiles: bool,
) -> Ended:
    """Run a block of the city in folder `out` and say how it ended: by what it is of (digest, version), as is asked for.

    options: of `streetloom run`. ends: when it is ended, done or not, seconds since 1970. tiles: whether its 3D Tiles are
    exported too, where they are not those of what it published.
    """
    folder, begun = out / BLOCKS / name, time.time()
    before = current_if_any(folder)
    command = ["run", str(block_file), "--out", str(folder), *options, "--json"]
    code, said, printed = _called(command, ends)
    try:
        summary: dict[str, Any] = json.loads(printed.strip().splitlines()[-1])
    except (IndexError, ValueError):
        summary = {}
    failures = [f"{one['unit']}: {one['reason']}" for one in summary.get("failures", ())]
    published = current_if_any(folder)
    anew = published is not None and (before is None or before.id != published.id or not (folder / OF_BLOCK).is_file())
    if code in (0, 1) and tiles and anew:
        exported, why, _ = _called(["export", str(folder), "--format", "3dtiles"], ends)
        if exported:
            code, said = (exported, why) if exported == TIME_IS_UP else (1, f"3D Tiles: {why}")
    return Ended(
        code=code,
        digest=digest,
        version=version,
        snapshot=published.id if published else "",
        summary={key: value for key, value in summary.items() if key not in _LEFT_OUT},
        reason="" if code == 0 else _reason(failures, said),
        seconds=round(time.time() - begun, 1),
    )


def _called(arguments: Sequence[str], ends: float | None) -> tuple[int, str, str]:
    """The command line with some arguments: its code, the last line of what it said, and what it printed."""
    process = subprocess.Popen(
        [sys.executable, "-m", "flows", *arguments],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=_follow,
    )
    try:
        printed, said = process.communicate(timeout=None if ends is None else max(ends - time.time(), 0.0))
        code = process.returncode
    except subprocess.TimeoutExpired:
        process.terminate()
        try:
            printed, said = process.communicate(timeout=PATIENCE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            printed, said = process.communicate()
        return TIME_IS_UP, "its time was up; what is done is kept", printed
    lines = [line.removeprefix("streetloom: ") for line in said.strip().splitlines()]
    return code if code >= 0 else 128 - code, lines[-1] if lines else "", printed


def _follow() -> None:
    """A block does not outlive the city's process, however that ends."""
    ctypes.CDLL(None).prctl(1, signal.SIGTERM)


def _reason(failures: Sequence[str], said: str) -> str:
    if not failures:
        return said
    return failures[0] if len(failures) == 1 else f"{failures[0]}; and {len(failures) - 1} more"
