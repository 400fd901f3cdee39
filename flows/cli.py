"""The command line. Heavy imports are inside the commands, so that --help answers at once."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any, cast

import click

EXISTING_FILE = click.Path(exists=True, dir_okay=False, path_type=Path)
EXISTING_FOLDER = click.Path(exists=True, file_okay=False, path_type=Path)
FOLDER = click.Path(file_okay=False, path_type=Path)


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


@main.command("new-block")
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


@main.command()
@click.argument("folder", metavar="FOLDER", type=EXISTING_FOLDER)
@click.option("--where", metavar="SQL", help="A condition on the columns of items.parquet, and on run.")
@click.option("--bbox", nargs=4, type=float, metavar="W S E N", help="Longitudes and latitudes.")
@click.option("--since", metavar="WHEN", help="Made since a date (2026-11-21), a time (UTC) or an age (36h, 7d).")
@click.option("--format", "style", type=click.Choice(["table", "json", "geojson"]), default="table", show_default=True)
def query(folder: Path, where: str | None, bbox: tuple[float, ...] | None, since: str | None, style: str) -> None:
    """Find facades in what a run published, or in what all runs in a folder did.

    \b
    Examples:
      streetloom query out/demo --where "floors >= 5 and occluded > 0.1"
      streetloom query out --since 7d --where "status = 'failed' and run <> 'demo'"
      streetloom query out/demo --bbox 24.94 60.16 24.95 60.17 --format geojson
    """
    from catalogs.query import format_items
    from catalogs.query import query as find

    click.echo(format_items(find(folder, where=where, bbox=bbox or None, since=since, note=_note), style))


@main.command()
@click.argument("folder", metavar="OUT", type=EXISTING_FOLDER)
@click.option(
    "--format",
    "style",
    required=True,
    type=click.Choice(["glb", "3dtiles", "cityjson", "cityjsonseq", "lod3", "coco", "labelme", "gpkg"]),
    help="glb, 3dtiles, cityjson(seq), lod3: models; coco, labelme: elements of the facades; gpkg: for QGIS.",
)
@click.option("--to", type=click.Path(path_type=Path), help="Where it goes.  [default: OUT/exports/FORMAT]")
@click.option("--building", "buildings", multiple=True, metavar="ID", help="Only this building; may be repeated.")
def export(folder: Path, style: str, to: Path | None, buildings: tuple[str, ...]) -> None:
    """Write what a run has published for other programs. An earlier export in the same place is replaced.

    \b
    Examples:
      streetloom export out/demo --format glb
      streetloom export out/demo --format 3dtiles --to tiles/
      streetloom export out/demo --format lod3 --building w123456 --building w123457
      streetloom export out/demo --format gpkg --to demo.gpkg
    """
    from flows.console import progress
    from tasks.export import export as write

    with progress(quiet=not sys.stderr.isatty()):
        done = write(folder, style, to, buildings)
    for line in done.notes:
        _note(line)
    for file in done.files:
        click.echo(file)


@main.command()
@click.argument("folder", metavar="FOLDER", type=EXISTING_FOLDER)
def catalog(folder: Path) -> None:
    """Write FOLDER/catalog.json, the STAC catalogue of all runs in a folder (or of one run).

    \b
    Example:
      streetloom catalog out
    """
    from catalogs.stac_catalog import write_catalog

    click.echo(write_catalog(folder, note=_note))


def _note(line: str) -> None:
    click.echo(f"streetloom: {line}", err=True)


@main.group()
def train() -> None:
    """Train the models that are shipped, from a data folder.

    \b
    Example:
      streetloom train parser --data ../shared/data --out parser/
    """


@train.command("parser")
@click.option("--data", type=EXISTING_FOLDER, required=True, help="Folder that holds facades/ and streetphotos/.")
@click.option("--out", type=FOLDER, required=True, help="Where the .onnx and its .json go, and where a run goes on.")
@click.option("--seed", default=0, show_default=True, help="0 is the shipped network's, 1 the shipped forest's.")
@click.option("--segmenter", type=click.Choice(["network", "forest"]), default="network", show_default=True)
@click.option(
    "--fold", type=click.Choice(["artdeco", "ruemonge2014"]), help="Go on from the network in OUT, to measure."
)
def train_parser(data: Path, out: Path, seed: int, segmenter: str, fold: str | None) -> None:
    """Train the facade parser (extra: train; `make train-setup`). An interrupted run goes on where it was.

    With --fold, the network in OUT learns the training part of a set whose licence allows no shipped weights, for the
    benchmark of that set.

    \b
    Examples:
      streetloom train parser --data ../shared/data --out parser/
      streetloom train parser --data ../shared/data --out parser/ --fold artdeco
      streetloom train parser --data ../shared/data --out forest/ --segmenter forest --seed 1
    """
    from flows.console import progress
    from tasks.train import train_fold, train_forest, train_network

    with progress(quiet=False):
        if fold:
            model = train_fold(data, out, fold, seed=seed)
        elif segmenter == "forest":
            model = train_forest(data, out, seed=seed)
        else:
            model = train_network(data, out, seed=seed)
    click.echo(model)


@train.command("layout")
@click.option("--data", type=EXISTING_FOLDER, required=True, help="Folder that holds layouts/.")
@click.option("--out", type=FOLDER, required=True, help="Where layouts.json goes.")
@click.option("--seed", default=1, show_default=True, help="1 is the shipped model's.")
@click.option("--fold", type=click.IntRange(0, 4), default=0, show_default=True, help="Every fifth facade to hold out.")
@click.option("--size", type=click.IntRange(10), help="Learn from so many of the facades only.")
def train_layout_model(data: Path, out: Path, seed: int, fold: int, size: int | None) -> None:
    """Train the layout model on layouts/cmp.jsonl without a fifth, and on the layouts in metres.

    \b
    Example:
      streetloom train layout --data ../shared/data --out layout/
    """
    from flows.console import progress
    from tasks.train_layout import train_layout

    with progress(quiet=False):
        model = train_layout(data, out, seed=seed, fold=fold, size=size)
    click.echo(model)


@main.command()
@click.argument("out", metavar="OUT", type=EXISTING_FOLDER)
@click.option(
    "--port", type=click.IntRange(0, 65535), default=8710, show_default=True, help="0 takes any that is free."
)
@click.option(
    "--host", default="127.0.0.1", show_default=True, help="Address to serve on; others see it only by theirs."
)
@click.option("--open/--no-open", "opened", default=True, show_default=True, help="Open the page in a browser.")
def view(out: Path, port: int, host: str, opened: bool) -> None:
    """Serve a page of the run in folder OUT: map, facades stage by stage, streets, the block in 3D. Ctrl-C ends it.

    \b
    Examples:
      streetloom view out/demo
      streetloom view out/mine --port 0 --no-open      beside a run that is still going
    """
    from facade_core.errors import InputError

    if not (out / "store").is_dir():
        raise InputError(
            f"{out}: no run has written here; name the folder that `streetloom run --out` wrote, or start the run"
        )
    try:
        from flows.viewer.app import serve
    except ModuleNotFoundError as error:
        raise InputError(f"the viewer needs {error.name}; install it with: pip install 'streetloom[viewer]'") from error

    def ready(address: str) -> None:
        click.echo(f"{address}  (Ctrl-C ends it)")
        if opened:
            import webbrowser

            webbrowser.open(address)

    serve(out, host, port, ready)


@main.command(context_settings={"ignore_unknown_options": True})
@click.argument("name", required=False)
@click.argument("options", nargs=-1, type=click.UNPROCESSED)
def bench(name: str | None, options: tuple[str, ...]) -> None:
    """Run a benchmark by name, which prints JSON; without a name, list them. OPTIONS are the benchmark's own.

    \b
    Examples:
      streetloom bench block --json
      streetloom bench parsing --data ../shared/data
    """
    import importlib
    import pkgutil

    import benchmarks

    names = sorted(module.name for module in pkgutil.iter_modules(benchmarks.__path__))
    if name is None:
        click.echo("\n".join(names))
        return
    if name not in names:
        raise click.BadParameter(f"{name}: there is {', '.join(names)}", param_hint="NAME")
    # every benchmark prints JSON; --json is accepted since all commands that can print it have it
    sys.argv = [f"benchmarks/{name}.py", *(option for option in options if option != "--json")]
    importlib.import_module(f"benchmarks.{name}").main()


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
    _note(f"doing street {', '.join(streets)} again; {others}{fate}")


if __name__ == "__main__":
    main()
