"""Command line. Heavy imports are inside the commands, so that --help answers at once."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar, cast

import click

from flows.cli.blocks import fetch, new_block
from flows.cli.city import city_command
from flows.cli.completions import complete_command
from flows.cli.corrections import import_
from flows.cli.doctor import doctor
from flows.cli.harvest import harvest
from flows.cli.imagery import fetch_imagery, match
from flows.cli.metrics import metrics
from flows.cli.new_city import new_city
from flows.cli.output import print_line, print_notice
from flows.cli.paths import EXISTING_FILE, EXISTING_FOLDER, OUT
from flows.cli.plan import plan_command
from flows.cli.prune import prune
from flows.cli.results import catalog, export, publish_page, query, view
from flows.cli.training import bench, train
from flows.cli.usage import single_line_errors

if TYPE_CHECKING:
    from catalogs.published.folders import Folder
    from facade_core.core.json_types import JsonObject
    from tasks.engine.run import Run

# Commands of the help, by heading.
COMMAND_GROUPS = {
    "Begin": ("demo", "new-block", "new-city", "fetch", "fetch-imagery", "match", "harvest", "plan"),
    "Run": ("run", "city"),
    "Use": ("view", "publish-page", "query", "complete", "export", "import", "catalog"),
    "Operate": ("doctor", "metrics", "prune"),
    "Develop": ("train", "bench"),
}

F = TypeVar("F", bound=Callable[..., object])


class OneLineErrorGroup(click.Group):
    """Group that ends every error with one line on stderr and an exit code."""

    def make_context(
        self, info_name: str | None, args: list[str], parent: click.Context | None = None, **extra: object
    ) -> click.Context:
        """Parse the command line; usage errors become one line."""
        with single_line_errors():
            return super().make_context(info_name, args, parent, **extra)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the commands under the headings of COMMAND_GROUPS."""
        for heading, names in COMMAND_GROUPS.items():
            with formatter.section(heading):
                formatter.write_dl([(name, self.commands[name].get_short_help_str(70)) for name in names])

    def invoke(self, ctx: click.Context) -> object:
        """Run the command; errors end it with one line and an exit code."""
        try:
            with single_line_errors(ctx):
                return super().invoke(ctx)
        except (click.ClickException, click.exceptions.Exit, click.Abort, BrokenPipeError):
            raise  # control flow of Click
        except Exception as error:
            from flows.cli.exit_codes import exit_code_and_message

            code, line = exit_code_and_message(error)
            print_notice(line)
            ctx.exit(code)


def _print_version(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:
    """Print the version with a digest of the code and libraries that determine the results."""
    if wanted and not ctx.resilient_parsing:
        from tasks.engine.stage_code import code_version
        from tasks.stages.order import CODE_STAGES

        print_line(f"streetloom {code_version(CODE_STAGES)}")
        ctx.exit()


@click.group(cls=OneLineErrorGroup, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.option(
    "--version",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_print_version,
    help="Print the version and a digest of the code.",
)
def command_line() -> None:
    """Turn an untextured city block into a textured, searchable one.

    \b
    Examples:
      streetloom demo                          the embedded block of central Helsinki
      streetloom new-block mine.yaml --osm city.osm.pbf --bbox 24.945 60.165 24.950 60.168
      streetloom run block.yaml --out out/mine
      streetloom city city.yaml --out out/city
      streetloom query out/mine --where "floors >= 5"
      streetloom view out/mine
      streetloom export out/mine --format 3dtiles
    """


@dataclass(frozen=True)
class RunOptions:
    """Options of a run on the command line; see the command `run`."""

    workers: int
    dask: str | None
    as_json: bool
    redo: str | None = None
    keep: int | None = None
    restyle: bool = False


def _compute_options(command: F) -> F:
    for option in (
        click.option(
            "--workers", default=2, show_default=True, type=click.IntRange(1, 256), help="Number of local processes."
        ),
        click.option("--dask", metavar="ADDRESS", help="Use this Dask scheduler, such as tcp://127.0.0.1:8786."),
        click.option("--json", "as_json", is_flag=True, help="Print a JSON object at the end."),
    ):
        command = option(command)
    return command


@command_line.command(short_help="Texture a block.")
@click.argument("block_file", metavar="BLOCK.yaml", type=EXISTING_FILE)
@click.option(
    "--out", type=OUT, help="Folder or s3://bucket/prefix of the results.  [default: out/NAME of the block file]"
)
@click.option("--redo", metavar="STREET", help="Repeat a street, by id or name.")
@click.option("--restyle", is_flag=True, help="Choose the exemplars of all buildings again.")
@click.option(
    "--keep", type=click.IntRange(1), metavar="N", help="Prune after the run: keep the N newest published snapshots."
)
@_compute_options
def run(
    block_file: Path,
    out: Folder | None,
    redo: str | None,
    restyle: bool,
    keep: int | None,
    workers: int,
    dask: str | None,
    as_json: bool,
) -> None:
    """Texture a block. Resumable and idempotent: finished work is not repeated.

    \b
    Examples:
      streetloom run block.yaml --out out/mine --workers 2
      streetloom run block.yaml --out out/mine --redo Kasarmikatu
      streetloom run block.yaml --out s3://bucket/mine
    """
    options = RunOptions(workers, dask, as_json, redo, keep, restyle)
    _run_block(block_file, out or Path("out") / block_file.stem, options)


@command_line.command(short_help="Texture the embedded block, streets of central Helsinki.")
@click.option(
    "--out", type=OUT, default="out/demo", show_default=True, help="Folder or s3://bucket/prefix of the results."
)
@click.option("--exemplars", type=EXISTING_FOLDER, help="Facade photos that replace the painted ones.")
@_compute_options
def demo(out: Folder, exemplars: Path | None, workers: int, dask: str | None, as_json: bool) -> None:
    """Texture the embedded block: streets of central Helsinki with painted facades. Needs no download.

    \b
    Examples:
      streetloom demo
      streetloom demo --exemplars facades/ --out out/photos
    """
    from catalogs.published.folders import local_run_folder
    from flows.lock import lock_folder
    from flows.output_folder import check_output_folder
    from tasks.examples.demo import write_demo

    check_output_folder(out)
    with lock_folder(out):
        block_file = write_demo(local_run_folder(out) / "input", exemplars)
    _run_block(block_file, out, RunOptions(workers, dask, as_json))


def _run_block(block_file: Path, out: Folder, options: RunOptions) -> None:
    import time
    from contextlib import ExitStack

    from flows.cli.first_run import note_first_run, note_large_block
    from flows.cli.interrupts import exit_on_signal
    from flows.console import console, print_status, print_summary
    from flows.run_entry import open_run
    from flows.step_reporter import report_steps, show_progress
    from tasks.engine.store.disk_space import require_disk_space
    from tasks.examples.demo import has_only_painted_pictures

    start = time.monotonic()
    again = partial(_mark_pending, options=options)
    with ExitStack() as held:
        with report_steps(announce=False) as notify:
            notify(f"reading {block_file}")
            entry = held.enter_context(open_run(block_file, out, notify=print_status, prepare=again, file_only=True))
        summary = entry.summary
        if summary is None:
            require_disk_space(entry.run.local)
            if entry.run.local != out.resolve():
                print_notice(f"log and the server's records are in {entry.run.local}")
            exit_on_signal()
            note_large_block(entry.block, block_file, options.workers)
            if options.dask is None:
                note_first_run()
            if options.dask is not None:  # fail before a server starts
                from tasks.engine.compute.connect import require_scheduler

                require_scheduler(options.dask)
            with show_progress():
                summary = _texture_recorded(entry.source, out, options.workers, options.dask)
        if options.keep is not None:
            from tasks.publish.prune import prune_snapshots_or_explain

            for line in prune_snapshots_or_explain(out, options.keep):
                print_notice(line)
    summary["seconds"] = round(time.monotonic() - start, 2)
    if options.as_json:
        click.echo(json.dumps(summary))
    else:
        print_summary(console, summary, is_painted=has_only_painted_pictures(entry.block))
    if "withheld" in summary:
        print_notice(summary["withheld"])
    if summary["facades_failed"] or summary["failures"]:
        sys.exit(1)


def _texture_recorded(block_file: Path, out: Folder, workers: int, dask: str | None) -> JsonObject:
    """Run the block with a record in Prefect's server; continue without the server where it fails."""
    from catalogs.published.folders import local_run_folder
    from facade_core.core.errors import FacadeError, TooManyFailuresError
    from flows.console import print_status
    from flows.server.startup import ServerDownError, provide_prefect_server

    with provide_prefect_server(local_run_folder(out) / "prefect") as record:
        from flows.block import (  # the import takes seconds, during which the server starts
            city_block,
            texture_block,
        )

        try:
            record.wait_until_ready()
            return cast("JsonObject", city_block(block_file, str(out), workers=workers, dask=dask))
        except TooManyFailuresError:
            pass  # reported in the summary
        except FacadeError:
            raise
        except ServerDownError as error:
            print_status(f"no Prefect server ({error}); the run continues without it and has no record there")
        except Exception as error:
            if record.is_answering() and not record.is_request_error(error):
                raise
            print_status(
                f"the Prefect server was lost ({record.describe_failure()}); the run continues without it, and its record "
                "there is incomplete"
            )
        return texture_block(block_file, out, workers=workers, dask=dask)


def _mark_pending(run: Run, options: RunOptions) -> None:
    """Mark what the options ask for pending, and print the streets."""
    if options.redo is not None:
        from tasks.stages.streets.redo import schedule_street_redo

        print_notice(f"doing street {', '.join(schedule_street_redo(run, options.redo))} again")
    if options.restyle:
        from tasks.stages.facades.exemplar_choices import delete_exemplar_choices

        delete_exemplar_choices(run)


for command in (
    new_block,
    new_city,
    fetch,
    city_command,
    plan_command,
    fetch_imagery,
    match,
    harvest,
    complete_command,
    query,
    export,
    import_,
    catalog,
    view,
    publish_page,
    doctor,
    metrics,
    prune,
    train,
    bench,
):
    command_line.add_command(command)


if __name__ == "__main__":
    command_line()
