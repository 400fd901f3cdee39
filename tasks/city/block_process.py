"""Run of one block of a city by the command line, in a process of its own that isolates its failures."""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from prefect import task
from prefect.cache_policies import NO_CACHE

from catalogs.published.folders import Folder, local_run_folder
from catalogs.published.snapshot import find_current_snapshot
from facade_core.core.json_types import JsonObject
from tasks.city.city_log import BLOCKS_FOLDER, BlockResult, block_tileset_path
from tasks.engine.commands import DEADLINE_EXIT_CODE, run_command

log = logging.getLogger(__name__)

# Exit code of sysexits.h for failures of the machine; a block with it is run again, as one with DEADLINE_EXIT_CODE is.
MACHINE_EXIT_CODE = 70
# Keys of a block's summary that do not describe its content.
_OMITTED_KEYS = ("outputs", "failures", "refused", "out", "seconds")


def block_output_path(out: Folder, name: str) -> Path:
    """Return the file on this machine that holds what a running block prints on stderr."""
    return local_run_folder(out) / "running" / f"{name}.txt"


@task(name="block", task_run_name="block {name}", cache_policy=NO_CACHE)
def run_block(
    out: Folder,
    name: str,
    block_file: Path,
    options: Sequence[str],
    previous: BlockResult,
    digest: str,
    version: str,
    deadline: float | None,
    tiles: bool,
) -> BlockResult:
    """Run a block of a city and return its result; a failure to start it is a result too.

    Parameters
    ----------
    out : folder of the city.
    name : name of the block.
    block_file : its block file.
    options : options of `streetloom run`.
    before : its previous result.
    digest : digest of the block's input, for the result.
    version : version of the code, for the result.
    deadline : Unix time at which the run is terminated; None: no limit.
    tiles : export 3D Tiles too, unless those of the published snapshot exist.
    """
    begun = time.time()
    try:
        printed = block_output_path(out, name)
        printed.parent.mkdir(parents=True, exist_ok=True)
        ended = _run_and_export(out / BLOCKS_FOLDER / name, block_file, options, previous, deadline, tiles, printed)
        printed.unlink(missing_ok=True)
    except Exception as error:  # no process or memory left: other blocks continue
        log.debug("block %s could not be run", name, exc_info=True)
        ended = BlockResult(MACHINE_EXIT_CODE, reason=f"could not be run: {' '.join(str(error).split())[:200]}")
    return replace(ended, digest=digest, version=version, seconds=round(time.time() - begun, 1))


def _run_and_export(
    folder: Folder,
    block_file: Path,
    options: Sequence[str],
    before: BlockResult,
    ends: float | None,
    tiles: bool,
    printed: Path,
) -> BlockResult:
    command = run_command(["run", str(block_file), "--out", str(folder), *options, "--json"], ends, printed)
    code, processor = command.code, command.processor_s
    try:
        summary: JsonObject = json.loads(command.output.strip().splitlines()[-1])
    except (IndexError, ValueError):
        summary = {}
    failures = [f"{one['unit']}: {one['reason']}" for one in summary.get("failures", ())]
    reason = "" if code == 0 else _failure_reason(failures, command.last_line)
    published = find_current_snapshot(folder)
    snapshot = published.id if published else ""
    tiled = (
        before.tiles if snapshot and before.tiles == snapshot and block_tileset_path(folder, snapshot).is_file() else ""
    )
    if code in (0, 1) and tiles and snapshot and not tiled:
        exported = run_command(["export", str(folder), "--format", "3dtiles"], ends, printed)
        processor += exported.processor_s
        if exported.code:
            code = DEADLINE_EXIT_CODE if exported.code == DEADLINE_EXIT_CODE else MACHINE_EXIT_CODE
            reason = f"3D Tiles: {exported.last_line}"
        else:
            tiled = snapshot
    summary_facts = {key: value for key, value in summary.items() if key not in _OMITTED_KEYS}
    return BlockResult(
        code=code, snapshot=snapshot, tiles=tiled, summary=summary_facts, reason=reason, processor=round(processor, 1)
    )


def _failure_reason(failures: Sequence[str], said: str) -> str:
    if not failures:
        return said
    return failures[0] if len(failures) == 1 else f"{failures[0]}; and {len(failures) - 1} more"
