"""Commands of a city: run it, and estimate the cost of a run."""

from __future__ import annotations

import json
import sys
from contextlib import suppress
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, cast

import click

from flows.city_options import CityOptions, next_time_of_day
from flows.cli.output import print_line, print_notice
from flows.cli.paths import EXISTING_FILE, OUT

if TYPE_CHECKING:
    from catalogs.published.folders import Folder
    from facade_core.core.json_types import JsonObject


@click.command("city", short_help="Texture a city block by block.")
@click.argument("city_file", metavar="CITY.yaml", type=EXISTING_FILE)
@click.option(
    "--out", type=OUT, help="Folder or s3://bucket/prefix of the results.  [default: out/NAME of the city file]"
)
@click.option(
    "--at-once", default=2, show_default=True, type=click.IntRange(1, 64), help="Number of concurrent blocks."
)
@click.option("--until", metavar="HH:MM", help="End the run at this time; the next run resumes.")
@click.option(
    "--tiles/--no-tiles", default=True, show_default=True, help="Export 3D Tiles of each block, for tileset.json."
)
@click.option(
    "--keep", type=click.IntRange(1), metavar="N", help="Keep the N newest published snapshots of each block."
)
@click.option("--restyle", is_flag=True, help="Choose the exemplars of all buildings again.")
@click.option("--workers", default=2, show_default=True, type=click.IntRange(1, 256), help="Number of local processes.")
@click.option("--dask", metavar="ADDRESS", help="Use this Dask scheduler, such as tcp://127.0.0.1:8786.")
@click.option("--json", "as_json", is_flag=True, help="Print a JSON object at the end.")
def city_command(
    city_file: Path,
    out: Folder | None,
    at_once: int,
    until: str | None,
    tiles: bool,
    keep: int | None,
    restyle: bool,
    workers: int,
    dask: str | None,
    as_json: bool,
) -> None:
    """Texture a city block by block. Resumable and idempotent: finished work is not repeated.

    \b
    Examples:
      streetloom city helsinki.yaml --out out/helsinki
      streetloom city helsinki.yaml --at-once 4 --workers 8 --until 06:00
      streetloom city helsinki.yaml --out s3://bucket/helsinki
      streetloom query out/helsinki --where "floors >= 5"
    """
    from flows.cli.first_run import note_first_run
    from flows.cli.interrupts import exit_on_signal
    from flows.lock import lock_folder
    from flows.output_folder import check_output_folder

    if until is not None:
        next_time_of_day(until, datetime.now())  # fail before any file is read
    out = out or Path("out") / city_file.stem
    check_output_folder(out)
    with lock_folder(out):
        exit_on_signal()
        _note_default_partition(city_file)
        if dask is None:
            note_first_run()
        summary = _run_city_recorded(city_file, out, CityOptions(workers, dask, at_once, until, keep, tiles, restyle))
    if as_json:
        click.echo(json.dumps(summary))
    else:
        print_city_summary(summary)
    sys.exit(_city_exit_code(summary))


def _note_default_partition(city_file: Path) -> None:
    """Print a notice where the city file states no `cut`; a block file is a valid city file too."""
    from catalogs.city.keys import DEFAULT_BLOCK_SIZE_M, uses_default_partition
    from catalogs.printable_text import format_command

    with suppress(ValueError):  # reported when the file is read
        if uses_default_partition(city_file):
            remedy = f"as one block: {format_command('run', city_file)}"
            print_notice(
                f"{city_file} states no `cut`: blocks of {DEFAULT_BLOCK_SIZE_M:g} m are cut along its streets; {remedy}"
            )


def _city_exit_code(summary: JsonObject) -> int:
    """Return 0 if all blocks are done, 70 after a machine fault, 1 after a failed block, 75 if the time ran out."""
    codes = [failure["code"] for failure in summary["failures"]]
    if any(code == 70 or code > 128 for code in codes):
        return 70
    if any(code != 75 for code in codes):
        return 1
    return 75 if summary["left"] else 0


def print_city_summary(summary: JsonObject) -> None:
    """Print what a run of a city did, and what of its inputs was left out or assumed."""
    from catalogs.printable_text import format_command, format_count
    from tasks.engine.forecast import describe_rejected_inputs

    print_line(
        f"{summary['city']}: {summary['blocks_done']} of {summary['blocks']} blocks done, "
        f"{format_count(summary['facades_done'], 'facade')} in {summary['seconds']:.0f} s; "
        f"{format_count(summary['blocks_skipped'], 'block')} done before"
    )
    for failure in summary["failures"]:
        print_line(f"  failed {failure['unit']}: {failure['reason']}")
    for _, id, reason in (entry for entry in summary["set_aside"] if entry[0] == "correction"):
        print_line(f"  waits  {id}: {reason}")
    for line in describe_rejected_inputs(entry for entry in summary["set_aside"] if entry[0] != "correction"):
        print_line(f"  input  {line}")
    for note in summary["notes"]:
        print_line(f"  input  {note}")
    if summary["left"]:
        print_line(f"  left   {', '.join(summary['left'][:8])}: run the same command to go on")
    if (estimate := summary["estimate"])["processor_hours_taken"]:
        print_line(f"  took   {_describe_estimate_use(estimate)}")
    print_line(f"  model  {summary['out']}/overview.glb")
    print_line(f"  look   {format_command('view', summary['out'])}")


def _describe_estimate_use(estimate: JsonObject) -> str:
    """Say how much of the estimated time of the processors the run took."""
    from flows.console import format_duration

    taken, estimated = (3600 * estimate[f"processor_hours{suffix}"] for suffix in ("_taken", ""))
    share = f", {taken / estimated:.0%} of the {format_duration(estimated)} that were estimated" if estimated else ""
    return f"{format_duration(taken)} of one processor{share}"


def _run_city_recorded(city_file: Path, out: Folder, options: CityOptions) -> JsonObject:
    """Run the city with a record in Prefect's server.

    Runs without the server where it is unavailable or nothing is pending.
    """
    from catalogs.published.folders import local_run_folder
    from flows.server.startup import ServerDownError, provide_prefect_server
    from flows.step_reporter import report_steps
    from tasks.city.city_log import load_or_partition_city

    with report_steps() as notify:
        log, _ = load_or_partition_city(city_file, out, notify)
    if not options.restyle and not log.pending_blocks(out, tiles=options.tiles):
        from flows.city import texture_city

        return texture_city(city_file, out, options)
    with provide_prefect_server(local_run_folder(out) / "prefect") as record:
        from flows.city import city as recorded
        from flows.city import texture_city

        try:
            record.wait_until_ready()
        except ServerDownError as error:
            print_notice(f"no Prefect server ({error}); the run continues without it and has no record there")
            return texture_city(city_file, out, options)
        return cast("JsonObject", recorded(city_file, str(out), **asdict(options)))
