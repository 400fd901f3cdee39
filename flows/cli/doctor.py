"""Command that checks the environment and the stores of runs."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from flows.cli.output import print_line
from flows.cli.paths import EXISTING_OUT

if TYPE_CHECKING:
    from catalogs.published.folders import Folder
    from tasks.doctor.findings import Finding

FINDING_WORDS = {True: "ok", False: "wrong", None: "note"}


@click.command(short_help="Check the environment and the state of a run.")
@click.argument("out", metavar="[OUT]", type=EXISTING_OUT, required=False)
@click.option("--json", "as_json", is_flag=True, help="Print a JSON object.")
def doctor(out: Folder | None, as_json: bool) -> None:
    """Check the environment, and report faults and stale units of the run in OUT, or of all runs below it.

    Lists the notes on the inputs and the inputs that were set aside. Reads the whole store; changes nothing. Exits with 1
    if there is a fault; each line names the remedy.

    \b
    Examples:
      streetloom doctor
      streetloom doctor out/mine
    """
    from itertools import chain

    from catalogs.printable_text import format_command
    from catalogs.published.folders import local_run_folder
    from facade_core.core.errors import InputError
    from flows.lock import is_locked
    from tasks.doctor import examine_machine

    if out and is_locked(out):
        raise InputError(f"{out}: a run is at work in it; wait for it, or look on: {format_command('view', out)}")
    found = []
    side = local_run_folder(out) if out else Path.cwd()
    disk = next(
        folder for folder in (side, *side.parents) if folder.is_dir()
    )  # the local folder of a bucket may not exist yet
    for finding in chain(examine_machine(disk), _examine_runs(out) if out else ()):
        found.append(finding)
        if not as_json:
            print_line(f"{FINDING_WORDS[finding.is_well]:<6} {finding.concern:<10} {finding.message}")
    well = all(finding.is_well is not False for finding in found)
    if as_json:
        lines = [{"concern": f.concern, "state": FINDING_WORDS[f.is_well], "said": f.message} for f in found]
        print_line(json.dumps({"ok": well, "findings": lines}))
    sys.exit(0 if well else 1)


def _examine_runs(out: Folder) -> Iterator[Finding]:
    """Return the findings of the run in a folder, or of a city's inputs and of each run below it with its name."""
    from catalogs.published.runs import find_runs_with_store
    from tasks.city.city_log import read_city_log
    from tasks.doctor import examine_folder
    from tasks.doctor.findings import Finding
    from tasks.engine.forecast import describe_rejected_inputs

    log = read_city_log(out)
    for line in (*log.notes, *describe_rejected_inputs(log.set_aside)):
        yield Finding("inputs", None, f"{log.name}: {line}")
    runs = {} if (out / "store").is_dir() else find_runs_with_store(out)
    if not runs:
        yield from examine_folder(out)
    for name, folder in runs.items():
        for finding in examine_folder(folder):
            yield replace(finding, message=f"{name}: {finding.message}")
