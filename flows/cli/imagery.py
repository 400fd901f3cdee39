"""The commands that fetch street pictures, and that match photos to walls."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from flows.cli.output import print_notice, print_line
from flows.cli.paths import EXISTING_FILE, EXISTING_FOLDER, FOLDER, NEW_FILE
from flows.cli.usage import BboxCommand

if TYPE_CHECKING:
    from tasks.fetching import Fetched

# Pictures that cannot be used, told one by one.
MAX_LISTED_FAULTS = 20


@click.command("fetch-imagery", cls=BboxCommand)
@click.argument("block_file", metavar="[BLOCK.yaml]", type=EXISTING_FILE, required=False)
@click.option(
    "--from",
    "source",
    default="panoramax",
    show_default=True,
    metavar="SOURCE",
    help="panoramax, mapillary, the https:// address of a STAC API, or a folder of panoramas.",
)
@click.option("--bbox", nargs=4, type=float, metavar="W S E N", help="Without a block: all there are in this box.")
@click.option("--to", type=FOLDER, help="Where pictures go.  [default: panoramas/ beside the block file]")
@click.option("--poses", type=EXISTING_FILE, help="Of a folder: where its pictures were taken.")
@click.option("--dates", metavar="FROM/TO", help="Taken then, such as 2023-01-01/2024-12-31 or 2025-01-01/..")
@click.option("--most", type=click.IntRange(1), metavar="N", help="No more than N, those first that show the most.")
@click.option("--licence", metavar="WORDS", help="Of pictures that state none, such as CC-BY-SA-4.0.")
def fetch_imagery(
    block_file: Path | None,
    source: str,
    bbox: tuple[float, float, float, float] | None,
    to: Path | None,
    poses: Path | None,
    dates: str | None,
    most: int | None,
    licence: str | None,
) -> None:
    """Fetch street panoramas: the fewest that show all facades of a block, into the folder that its file names for them.

    What was fetched is not fetched again; `streetloom run` textures with it. A service that wants a token has it from
    the environment, STREETLOOM_IMAGERY_TOKEN. Who took each picture, when, and its licence are in poses.json.

    \b
    Examples:
      streetloom fetch-imagery block.yaml
      streetloom fetch-imagery block.yaml --from mapillary --dates 2024-01-01/..
      streetloom fetch-imagery block.yaml --from https://panoramax.example.org/api --most 50
      streetloom fetch-imagery block.yaml --from my-panoramas/ --licence "mine"
      streetloom fetch-imagery --bbox 7.750 48.581 7.754 48.583 --to pictures/
    """
    from facade_core.core.errors import InputError
    from flows.cli.interrupts import exit_on_signal

    if (block_file is None) == (bbox is None):
        raise click.UsageError("name a block file, or --bbox W S E N with --to FOLDER")
    exit_on_signal("interrupted; what was fetched stays, run the same command to go on")
    if block_file is not None:
        report_fetched(fetch_block_imagery(block_file, source, to, poses, dates, most, licence))
        print_line(f"ready: streetloom run {block_file}")
        return
    if to is None:
        raise InputError("--bbox: there is no block file to lay pictures beside; name a folder with --to")
    from catalogs.imagery.services import resolve_service
    from flows.console import show_progress
    from tasks.fetching import fetch_for_box

    assert bbox is not None
    with show_progress(quiet=not sys.stderr.isatty()):
        found = fetch_for_box(bbox, to, resolve_service(source, poses), dates=dates, most=most, licence=licence)
    report_fetched(found)


@click.command("match")
@click.argument("block_file", metavar="BLOCK.yaml", type=EXISTING_FILE)
@click.argument("photos", type=EXISTING_FOLDER)
@click.option(
    "--poses", type=EXISTING_FILE, help="Where photos were taken, instead of their EXIF: CSV of file,lon,lat,heading."
)
@click.option("--out", type=NEW_FILE, help="The table.  [default: matches.csv beside the block file]")
@click.option(
    "--take", "taken", type=EXISTING_FILE, metavar="TABLE", help="Copy the photos to the block, as this table says."
)
def match(block_file: Path, photos: Path, poses: Path | None, out: Path | None, taken: Path | None) -> None:
    """Find out which facades photos show: by where they say they were taken, and what they show of walls and roofs.

    Photos are as taken from the street, under any name, the wall in their middle. A table tells the facade of each that
    is sure, and the candidates of the others: write the right one into its column `facade`, or leave it empty. With --take
    its photos are copied to the block's, under their facades' names; copies of before that it says otherwise of now go.
    `streetloom view OUT --edit --photos PHOTOS` shows them beside their candidates, to choose on a page.

    \b
    Examples:
      streetloom match block.yaml my-photos/
      streetloom match block.yaml my-photos/ --take matches.csv
    """
    from facade_core.core.errors import InputError
    from flows.console import show_progress
    from tasks.matching.finding import PLACES, UNPLACED, match_photos
    from tasks.matching.table import TABLE, read_table, write_table
    from tasks.matching.taking import take, taking

    if taken is not None:
        if poses is not None or out is not None:
            raise click.UsageError(
                "--take: the photos' places and the table are those of before; leave out --poses and --out"
            )
        found = taking(block_file, photos, read_table(taken))
        by_hand = take(found)
        print_line(f"photos     {found.count} taken")
        if by_hand:
            print_notice(f"write into the block file: {by_hand}")
        print_line(f"ready: streetloom run {block_file}")
        return
    table = out or block_file.parent / TABLE
    with show_progress(quiet=not sys.stderr.isatty()):
        found_table, faults = match_photos(block_file, photos, table, poses)
    for fault in faults:
        print_notice(f"{fault.id}: {fault.reason}")
    if any(fault.reason == UNPLACED for fault in faults):
        print_notice(f"of those without a place: {PLACES}")
    matches = found_table.matches()
    if not matches:
        raise InputError(f"{photos}: none of its photos can be placed; give their places with --poses")
    write_table(found_table, new=True)
    for one in matches:
        told = ", ".join(f"{each.facade} ({each.probability:.2f})" for each in one.candidates)
        sure = (
            f"{one.facade} ({one.candidates[0].probability:.2f})"
            if one.facade
            else f"? {told or 'no wall of the block'}"
        )
        print_line(f"{one.photo}  {sure}")
    print_line(f"{sum(bool(one.facade) for one in matches)} of {len(matches)} are sure; the others' candidates: {table}")
    if out is None:
        print_line(f"to decide on a page: streetloom view OUT --edit --photos {photos}")
    print_line(f"then: streetloom match {block_file} {photos} --take {table}")


def fetch_block_imagery(
    block_file: Path,
    source: str,
    to: Path | None = None,
    poses: Path | None = None,
    dates: str | None = None,
    most: int | None = None,
    licence: str | None = None,
) -> Fetched:
    """Fetch the panoramas of a block, with bars in a terminal."""
    from catalogs.imagery.services import resolve_service
    from flows.console import show_progress
    from tasks.fetching import fetch_for_block

    with show_progress(quiet=not sys.stderr.isatty()):
        return fetch_for_block(block_file, resolve_service(source, poses), to=to, dates=dates, most=most, licence=licence)


def report_fetched(fetched: Fetched) -> None:
    """Say what was fetched; exit with 1 where another run may bring what is missing."""
    for fault in fetched.faults[:MAX_LISTED_FAULTS]:
        print_notice(f"{fault.id}: {fault.reason}")
    if len(fetched.faults) > MAX_LISTED_FAULTS:
        print_notice(f"{len(fetched.faults) - MAX_LISTED_FAULTS} pictures more cannot be used")
    for line in fetched.lines():
        print_line(line)
    if fetched.named:
        print_notice(f"write into the block file: {fetched.named}")
    if fetched.missing:
        print_notice(f"{fetched.missing} pictures could not be had; run the same command again")
        sys.exit(1)
