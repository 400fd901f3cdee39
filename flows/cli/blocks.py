"""Commands that create a block to run."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from flows.cli.imagery import fetch_block_imagery, print_imagery_fetch
from flows.cli.output import print_command, print_line
from flows.cli.paths import EXISTING_FILE, EXISTING_FOLDER, FOLDER, NEW_FILE
from flows.cli.usage import BboxCommand

if TYPE_CHECKING:
    from tasks.examples.new_block import MapFiles


@click.command("new-block", cls=BboxCommand, short_help="Write a block file for a part of a map.")
@click.argument("block_file", metavar="BLOCK.yaml", type=NEW_FILE)
@click.option("--osm", type=EXISTING_FILE, help="Map extract with buildings and streets (.osm.pbf).")
@click.option(
    "--buildings", type=EXISTING_FILE, help="Alternative to --osm: buildings in any format that a block file accepts."
)
@click.option(
    "--streets", type=EXISTING_FILE, help="Streets of --buildings.  [default: derived from the gaps between buildings]"
)
@click.option("--crs", metavar="CRS", help="CRS of --buildings, such as EPSG:28992, and of --streets that state none.")
@click.option("--bbox", nargs=4, type=float, metavar="W S E N", help="Area in degrees of longitude and latitude.")
@click.option("--around", nargs=2, type=float, metavar="LON LAT", help="Alternative to --bbox: centre of a square.")
@click.option(
    "--size",
    type=click.FloatRange(min=50.0, max=5000.0),
    metavar="METRES",
    default=200.0,
    show_default=True,
    help="Side of the square; without --bbox and --around, of the most densely built square.",
)
@click.option("--photos", type=EXISTING_FOLDER, help="Panoramas with a pose, or photos named after a facade.")
@click.option("--poses", type=EXISTING_FILE, help="Positions of panoramas without position metadata.")
@click.option("--exemplars", type=EXISTING_FOLDER, help="Rectified facade pictures.  [default: painted ones]")
@click.option("--imagery", metavar="SOURCE", help="Also fetch panoramas, as `streetloom fetch-imagery --from SOURCE`.")
def new_block(
    block_file: Path,
    osm: Path | None,
    buildings: Path | None,
    streets: Path | None,
    crs: str | None,
    bbox: tuple[float, ...] | None,
    around: tuple[float, float] | None,
    size: float,
    photos: Path | None,
    poses: Path | None,
    exemplars: Path | None,
    imagery: str | None,
) -> None:
    """Write a block file for a part of a map and print a summary of its contents.

    \b
    Examples:
      streetloom new-block mine.yaml --osm city.osm.pbf
      streetloom new-block mine.yaml --osm city.osm.pbf --around 24.947 60.166 --size 300
      streetloom new-block mine/mine.yaml --osm city.osm.pbf --bbox 24.945 60.165 24.950 60.168 --photos photos/
      streetloom new-block mine.yaml --buildings houses.gpkg --streets roads.gpkg --crs EPSG:3067
      streetloom new-block mine/mine.yaml --osm city.osm.pbf --bbox 24.945 60.165 24.950 60.168 --imagery panoramax
    """
    from flows.cli.interrupts import unwind_on_signal
    from flows.step_reporter import report_steps
    from tasks.examples.new_block import SquareArea
    from tasks.examples.new_block import write_new_block as write

    if bbox and around:
        raise click.UsageError("give --bbox or --around, not both")
    area = bbox or (SquareArea(*around, size) if around else size)
    map_files = require_map_files(osm, buildings, streets, crs)
    with unwind_on_signal(), report_steps() as notify:
        found = write(block_file, map_files, area, photos, exemplars, poses, notify=notify)
    for line in found.lines():
        print_line(line)
    if imagery is not None:
        print_imagery_fetch(fetch_block_imagery(block_file, imagery))
    print_command("ready", "run", block_file)


def require_map_files(osm: Path | None, buildings: Path | None, streets: Path | None, crs: str | None) -> MapFiles:
    """Return the map that options name; raise click.UsageError where it is missing or ambiguous."""
    from tasks.examples.new_block import MapFiles

    if osm is None and buildings is None:
        raise click.UsageError("give a map as --osm FILE.osm.pbf, or buildings of another format as --buildings FILE")
    if osm is not None and (buildings or streets):
        raise click.UsageError("--osm holds buildings and streets; give it, or --buildings and --streets")
    if osm is None:
        assert buildings is not None
        return MapFiles(buildings, streets, crs)
    if osm.suffix.lower() != ".pbf":
        raise click.UsageError(
            f"--osm: {osm} is no .osm.pbf; give it as --buildings {shlex.quote(str(osm))}, and its streets as --streets"
        )
    return MapFiles(osm, osm, crs)


@click.command(short_help="Fetch a real example block and its public data.")
@click.argument("name", required=False)
@click.option("--out", type=FOLDER, default=Path("blocks"), show_default=True, help="Folder of the data and the block.")
def fetch(name: str | None, out: Path) -> None:
    """Fetch a real example block and its public data; without NAME, list the examples.

    \b
    Examples:
      streetloom fetch
      streetloom fetch delfshaven --out blocks
    """
    from catalogs.examples.sources import EXAMPLE_SOURCES
    from flows.step_reporter import show_progress
    from tasks.examples.fetch import fetch_block

    if name is None:
        for known, source in EXAMPLE_SOURCES.items():
            print_line(f"{known:<14} {len(source.files):>2} files  {source.licence}")
        return
    with show_progress(quiet=not sys.stderr.isatty()):
        block, source = fetch_block(name, out)
    print_line(f"licence: {source.licence}")
    print_command("ready", "run", block)
