"""The commands that look at what runs published."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from flows.cli_paths import EXISTING_FOLDER


@click.command()
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


@click.command()
@click.argument("folder", metavar="OUT", type=EXISTING_FOLDER)
@click.option(
    "--format",
    "style",
    required=True,
    type=click.Choice(["glb", "3dtiles", "cityjson", "cityjsonseq", "lod3", "coco", "labelme", "gpkg"]),
    help="glb, 3dtiles, cityjson(seq), lod3: models; coco, labelme: elements of the facades; gpkg: for QGIS.",
)
@click.option("--to", type=click.Path(path_type=Path), help="Folder, or FILE.gpkg.  [default: OUT/exports/FORMAT]")
@click.option("--building", "buildings", multiple=True, metavar="ID", help="Only this building; may be repeated.")
def export(folder: Path, style: str, to: Path | None, buildings: tuple[str, ...]) -> None:
    """Write what a run has published for other programs. An earlier one in the same place is replaced if untouched.

    \b
    Examples:
      streetloom export out/demo --format glb
      streetloom export out/demo --format 3dtiles --to tiles/
      streetloom export out/demo --format lod3 --building w123949253
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


@click.command()
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


@click.command()
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
