"""Command that creates a city to run."""

from __future__ import annotations

from pathlib import Path

import click

from flows.cli.blocks import require_map_files
from flows.cli.output import print_command, print_line
from flows.cli.paths import EXISTING_FILE, EXISTING_FOLDER, NEW_FILE
from flows.cli.usage import BboxCommand


@click.command("new-city", cls=BboxCommand, short_help="Write a city file for a map or a part of it.")
@click.argument("city_file", metavar="CITY.yaml", type=NEW_FILE)
@click.option("--osm", type=EXISTING_FILE, help="Map extract with buildings and streets (.osm.pbf).")
@click.option(
    "--buildings", type=EXISTING_FILE, help="Alternative to --osm: buildings in any format that a block file accepts."
)
@click.option("--streets", type=EXISTING_FILE, help="Streets of --buildings, along which the city is cut.")
@click.option("--crs", metavar="CRS", help="CRS of --buildings, such as EPSG:28992, and of --streets that state none.")
@click.option(
    "--bbox", nargs=4, type=float, metavar="W S E N", help="Area in degrees of longitude and latitude.  [default: all]"
)
@click.option("--block-size", type=float, metavar="METRES", help="Side of a block.  [default: 400]")
@click.option("--panoramas", type=EXISTING_FOLDER, help="Panoramas with a pose.")
@click.option("--exemplars", type=EXISTING_FOLDER, help="Rectified facade pictures.  [default: painted ones]")
def new_city(
    city_file: Path,
    osm: Path | None,
    buildings: Path | None,
    streets: Path | None,
    crs: str | None,
    bbox: tuple[float, ...] | None,
    block_size: float | None,
    panoramas: Path | None,
    exemplars: Path | None,
) -> None:
    """Write a city file with comments, for a map or a part of it.

    \b
    Examples:
      streetloom new-city helsinki.yaml --osm city.osm.pbf
      streetloom new-city centre/centre.yaml --osm city.osm.pbf --bbox 24.93 60.16 24.96 60.18 --block-size 300
      streetloom new-city delft.yaml --buildings houses.gpkg --streets roads.gpkg --crs EPSG:28992
    """
    from tasks.examples.new_city import CityInputs, write_new_city

    map_files = require_map_files(osm, buildings, streets, crs)
    write_new_city(city_file, CityInputs(map_files, bbox, block_size, exemplars, panoramas))
    print_line(f"written: {city_file}; its comments explain what can be added")
    print_command("cost", "plan", city_file)
    print_command("ready", "city", city_file)
