"""The command line. Heavy imports are inside the commands, so that --help answers at once."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any, cast

import click

from flows.cli_box import WithBox
from flows.cli_paths import EXISTING_FILE, EXISTING_FOLDER, FOLDER
from flows.cli_results import catalog, export, query, view
from flows.cli_training import bench, train


class Commands(click.Group):
    """Turns the project's errors into one line on stderr and exit code 2."""

    def invoke(self, ctx: click.Context) -> Any:
        from facade_core.errors import FacadeError

        try:
            return super().invoke(ctx)
        except FacadeError as error:
            click.echo(f"streetloom: {' '.join(str(error).split())}", err=True)
            ctx.exit(2)


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(package_name="streetloom")
def main() -> None:
    """Turns an untextured city block into a textured, searchable one.

    \b
    Examples:
      streetloom demo                          the embedded block of central Helsinki
      streetloom new-block mine.yaml --osm city.osm.pbf --bbox 24.945 60.165 24.950 60.168
      streetloom run block.yaml --out out/mine
      streetloom query out/mine --where "floors >= 5"
      streetloom view out/mine
      streetloom export out/mine --format 3dtiles
    """


def _compute_options(command: Any) -> Any:
    for option in (
        click.option("--workers", default=2, show_default=True, type=click.IntRange(1), help="Local processes."),
        click.option("--dask", metavar="ADDRESS", help="Use this Dask scheduler, such as tcp://127.0.0.1:8786."),
        click.option("--json", "as_json", is_flag=True, help="Print one JSON object last."),
    ):
        command = option(command)
    return command


@main.command()
@click.argument("block_file", metavar="BLOCK.yaml", type=EXISTING_FILE)
@click.option("--out", type=FOLDER, help="Where results go.  [default: out/NAME of the block file]")
@click.option(
    "--redo", metavar="STREET", help="Do a street again, by id or name, and the later ones that read its texels."
)
@click.option("--only", is_flag=True, help="With --redo: that street alone; the later ones are marked stale.")
@_compute_options
def run(
    block_file: Path,
    out: Path | None,
    redo: str | None,
    only: bool,
    workers: int,
    dask: str | None,
    as_json: bool,
) -> None:
    """Texture a block. What an earlier run finished is not done again.

    \b
    Examples:
      streetloom run block.yaml --out out/mine --workers 2
      streetloom run block.yaml --out out/mine --redo Kasarmikatu --only
    """
    if only and redo is None:
        raise click.UsageError("--only needs --redo STREET")
    _run(block_file, out or Path("out") / block_file.stem, workers, dask, as_json, redo, only)


@main.command()
@click.option("--out", type=FOLDER, default=Path("out/demo"), show_default=True, help="Where results go.")
@click.option("--exemplars", type=EXISTING_FOLDER, help="Facade photos to use instead of the painted ones.")
@_compute_options
def demo(out: Path, exemplars: Path | None, workers: int, dask: str | None, as_json: bool) -> None:
    """Texture the embedded block: streets of central Helsinki with painted facades. Needs no download.

    \b
    Examples:
      streetloom demo
      streetloom demo --exemplars facades/ --out out/photos
    """
    from flows.lock import locked
    from tasks.demo import write_demo

    with locked(out):
        block_file = write_demo(out / "input", exemplars)
    _run(block_file, out, workers, dask, as_json)


@main.command("new-block", cls=WithBox)
@click.argument("block_file", metavar="BLOCK.yaml", type=click.Path(dir_okay=False, path_type=Path))
@click.option("--osm", type=EXISTING_FILE, required=True, help="Map extract with buildings and streets (.osm.pbf).")
@click.option("--bbox", nargs=4, type=float, required=True, metavar="W S E N", help="Longitudes and latitudes.")
@click.option("--photos", type=EXISTING_FOLDER, help="Panoramas with a pose, or photos named after a facade.")
@click.option("--poses", type=EXISTING_FILE, help="Where panoramas were taken, if they do not say so themselves.")
@click.option("--exemplars", type=EXISTING_FOLDER, help="Rectified facade pictures.  [default: painted ones]")
def new_block(
    block_file: Path,
    osm: Path,
    bbox: tuple[float, ...],
    photos: Path | None,
    poses: Path | None,
    exemplars: Path | None,
) -> None:
    """Write a block file for a part of a map, and say what was found there.

    \b
    Example:
      streetloom new-block mine/mine.yaml --osm city.osm.pbf --bbox 24.945 60.165 24.950 60.168 --photos photos/
    """
    from flows.console import progress
    from tasks.new_block import new_block as write

    with progress(quiet=not sys.stderr.isatty()):
        found = write(block_file, osm, bbox, photos, exemplars, poses)
    click.echo("\n".join(found.lines()))
    click.echo(f"ready: streetloom run {block_file}")


@main.command()
@click.argument("name", required=False)
@click.option("--out", type=FOLDER, default=Path("blocks"), show_default=True, help="Where the data and the block go.")
def fetch(name: str | None, out: Path) -> None:
    """Fetch a real example block and its public data; without NAME, list them.

    \b
    Examples:
      streetloom fetch
      streetloom fetch delfshaven --out blocks
    """
    from catalogs.sources import SOURCES
    from flows.console import progress
    from tasks.fetch import fetch_block

    if name is None:
        for known, source in SOURCES.items():
            click.echo(f"{known:<14} {len(source.files):>2} files  {source.licence}")
        return
    with progress(quiet=not sys.stderr.isatty()):
        block, source = fetch_block(name, out)
    click.echo(f"licence: {source.licence}")
    click.echo(f"ready: streetloom run {block}")


def _run(
    block_file: Path,
    out: Path,
    workers: int,
    dask: str | None,
    as_json: bool,
    redo: str | None = None,
    only: bool = False,
) -> None:
    import time

    from catalogs.block import read_block
    from flows.console import console, progress, show
    from flows.interrupts import end_on_interrupt
    from flows.lock import locked
    from flows.server import server
    from tasks.run import run_of
    from tasks.standing import nothing_due

    start = time.monotonic()
    run = run_of(read_block(block_file), out)
    with locked(out):
        if redo is not None:
            _redo(run, redo, only)
        summary = nothing_due(run)
        if summary is None:
            end_on_interrupt()
            with progress(quiet=as_json and not sys.stderr.isatty()), server(out / "prefect") as ready:
                from flows.block import city_block  # takes seconds, in which the server starts

                ready()
                alone = redo if only else None
                done = city_block(block_file.resolve(), out, workers=workers, dask=dask, only=alone)
                summary = cast(dict[str, Any], done)
    summary["seconds"] = round(time.monotonic() - start, 2)
    if as_json:
        click.echo(json.dumps(summary))
    else:
        show(console, summary)
    if summary["facades_failed"] or summary["failures"]:
        sys.exit(1)


def _redo(run: Any, street: str, only: bool) -> None:
    """Make a street due again and say what else is."""
    from tasks.streets import redo_street

    streets, dependants = redo_street(run, street, only=only)
    others = f"{', '.join(dependants) or 'no other street'} {'reads' if len(dependants) < 2 else 'read'} its texels"
    fate = ", marked stale until the next run" if only and dependants else ""
    click.echo(f"streetloom: doing street {', '.join(streets)} again; {others}{fate}", err=True)


for command in (query, export, catalog, view, train, bench):
    main.add_command(command)


if __name__ == "__main__":
    main()
