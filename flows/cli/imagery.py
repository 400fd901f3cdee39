"""Commands that fetch street imagery and match photos to walls."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from flows.cli.output import print_command, print_line, print_notice
from flows.cli.paths import EXISTING_FILE, EXISTING_FOLDER, FOLDER, NEW_FILE
from flows.cli.usage import BboxCommand

if TYPE_CHECKING:
    from tasks.fetching import ImageryFetchResult

# Unusable pictures that are listed one by one.
MAX_LISTED_FAULTS = 20


@click.command("fetch-imagery", cls=BboxCommand, short_help="Fetch street panoramas of a block.")
@click.argument("block_file", metavar="[BLOCK.yaml]", type=EXISTING_FILE, required=False)
@click.option(
    "--from",
    "source",
    default="panoramax",
    show_default=True,
    metavar="SOURCE",
    help="panoramax, mapillary, the https:// address of a STAC API, or a folder of panoramas.",
)
@click.option("--bbox", nargs=4, type=float, metavar="W S E N", help="Without a block: all pictures in this box.")
@click.option("--to", type=FOLDER, help="Folder of the pictures.  [default: panoramas/ next to the block file]")
@click.option("--poses", type=EXISTING_FILE, help="With --from FOLDER: positions of its pictures.")
@click.option("--dates", metavar="FROM/TO", help="Capture dates, such as 2023-01-01/2024-12-31 or 2025-01-01/..")
@click.option(
    "--most", type=click.IntRange(1), metavar="N", help="Maximum number of pictures, the most informative first."
)
@click.option("--licence", metavar="WORDS", help="Licence of pictures without one, such as CC-BY-SA-4.0.")
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
    """Fetch street panoramas: the smallest set that covers all facades of a block, into the folder named in its file.

    Pictures from an earlier fetch are kept and not fetched again; `streetloom run` textures with them. A service token is
    read from the environment variable STREETLOOM_IMAGERY_TOKEN. poses.json records author, date and licence of each
    picture.

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
        print_imagery_fetch(fetch_block_imagery(block_file, source, to, poses, dates, most, licence))
        print_command("ready", "run", block_file)
        return
    if to is None:
        raise InputError("--bbox: there is no block file to lay pictures beside; name a folder with --to")
    from catalogs.imagery.services import resolve_service
    from flows.step_reporter import show_progress
    from tasks.fetching import fetch_box_panoramas

    assert bbox is not None
    with show_progress(quiet=not sys.stderr.isatty()):
        found = fetch_box_panoramas(
            bbox, to, resolve_service(source, poses), dates=dates, max_count=most, licence=licence
        )
    print_imagery_fetch(found)


@click.command("match", short_help="Match photos to facades.")
@click.argument("block_file", metavar="BLOCK.yaml", type=EXISTING_FILE)
@click.argument("photos", type=EXISTING_FOLDER)
@click.option(
    "--poses", type=EXISTING_FILE, help="Positions of photos instead of their EXIF: CSV of file,lon,lat,heading."
)
@click.option("--out", type=NEW_FILE, help="Output table.  [default: matches.csv next to the block file]")
@click.option(
    "--take",
    "taken",
    type=EXISTING_FILE,
    metavar="TABLE",
    help="Copy the photos into the block according to this table.",
)
@click.option(
    "--cameras",
    type=NEW_FILE,
    metavar="FILE.csv",
    help="Find the poses of overlapping photos instead (`make sfm-setup`), and write them to this file.",
)
def match(
    block_file: Path, photos: Path, poses: Path | None, out: Path | None, taken: Path | None, cameras: Path | None
) -> None:
    """Match photos to facades by their recorded positions and by the walls and roofs that they show.

    Photos are taken from the street, under any name, with the wall in the middle. The output table has the facade of each
    certain match and the candidates of the others: enter the correct one in its column `facade`, or leave it empty. --take
    copies the photos of the table into the block's folder, named after their facades, and removes earlier copies that the
    table contradicts. `streetloom view OUT --edit --photos PHOTOS` shows photos and candidates on a page.

    --cameras makes posed pictures of overlapping photos, taken every few steps along a street. Structure from motion finds
    their poses; GPS and the walls of the block place them. `imagery.cameras` of the block file then names folder and file.

    \b
    Examples:
      streetloom match block.yaml my-photos/
      streetloom match block.yaml my-photos/ --cameras cameras.csv
      streetloom match block.yaml my-photos/ --take matches.csv
    """
    from catalogs.printable_text import format_unit_reason
    from facade_core.core.errors import InputError
    from flows.step_reporter import show_progress
    from tasks.matching.match_table import TABLE, read_match_table, write_match_table
    from tasks.matching.photo_import import import_photos, plan_photo_import
    from tasks.matching.photo_matches import MISSING_PLACE, match_photos, place_remedy

    if cameras is not None:
        if out is not None or taken is not None:
            raise click.UsageError("--cameras writes no table of facades; leave out --out and --take")
        _match_cameras(block_file, photos, cameras, poses)
        return
    if taken is not None:
        if poses is not None or out is not None:
            raise click.UsageError("--take reads the table of an earlier match; leave out --poses and --out")
        found = plan_photo_import(block_file, photos, read_match_table(taken))
        by_hand = import_photos(found)
        print_line(f"photos     {found.count} taken")
        if by_hand:
            print_notice(f"write into the block file: {by_hand}")
        print_command("ready", "run", block_file)
        return
    table = out or block_file.parent / TABLE
    with show_progress(quiet=not sys.stderr.isatty()):
        found_table, faults, notes = match_photos(block_file, photos, table, poses)
    for note in notes:
        print_notice(note)
    for fault in faults:
        print_notice(format_unit_reason(fault.id, fault.reason))
    if any(fault.reason == MISSING_PLACE for fault in faults):
        print_notice(f"photos without a position: {place_remedy(poses)}")
    matches = found_table.matches()
    if not matches:
        raise InputError(
            f"{photos}: none of its photos can be matched, for the reasons above; correct those, or name each photo after "
            "its facade"
        )
    write_match_table(found_table, new=True)
    for photo in matches:
        candidates = ", ".join(f"{each.facade} ({each.probability:.2f})" for each in photo.candidates)
        result = (
            f"{photo.facade} ({photo.candidates[0].probability:.2f})"
            if photo.facade
            else f"? {candidates or 'no wall of the block'}"
        )
        print_line(f"{photo.photo}  {result}")
    print_line(
        f"{sum(bool(photo.facade) for photo in matches)} of {len(matches)} are certain; candidates of the others: {table}"
    )
    if out is None:
        print_command("decide on a page", "view", "OUT", "--edit", "--photos", photos)
    print_command("then", "match", block_file, photos, "--take", table)


def _match_cameras(block_file: Path, photos: Path, path: Path, poses: Path | None) -> None:
    """Write the poses of photos to a file of cameras, and print what could not be placed."""
    from catalogs.printable_text import format_unit_reason
    from flows.step_reporter import show_progress
    from tasks.matching.photo_cameras import format_cameras_entry, pose_block_photos, write_camera_table

    with show_progress(quiet=not sys.stderr.isatty()):
        found = pose_block_photos(block_file, photos, path, poses)
    for fault in found.faults:
        print_notice(format_unit_reason(fault.id, fault.reason))
    for note in found.notes:
        print_notice(note)
    write_camera_table(path, found.cameras)
    print_line(f"photos     {len(found.cameras)} placed, {len(found.faults)} not")
    print_line(f"cameras    {path}")
    print_notice(f"write into the block file: {format_cameras_entry(block_file, photos, path)}")
    print_command("ready", "run", block_file)


def fetch_block_imagery(
    block_file: Path,
    source: str,
    to: Path | None = None,
    poses: Path | None = None,
    dates: str | None = None,
    most: int | None = None,
    licence: str | None = None,
) -> ImageryFetchResult:
    """Fetch the panoramas of a block, with progress bars in a terminal.

    Parameters
    ----------
    block_file : the block.
    source, to, poses, dates, most, licence : as of the command `fetch-imagery`.
    """
    from catalogs.imagery.services import resolve_service
    from flows.step_reporter import show_progress
    from tasks.fetching import fetch_block_panoramas

    with show_progress(quiet=not sys.stderr.isatty()):
        return fetch_block_panoramas(
            block_file, resolve_service(source, poses), to=to, dates=dates, max_count=most, licence=licence
        )


def print_imagery_fetch(fetched: ImageryFetchResult) -> None:
    """Print the fetched pictures; exit with 1 if another run may fetch the missing ones."""
    from catalogs.printable_text import format_count, format_unit_reason

    for fault in fetched.faults[:MAX_LISTED_FAULTS]:
        print_notice(format_unit_reason(fault.id, fault.reason))
    if len(fetched.faults) > MAX_LISTED_FAULTS:
        print_notice(f"{len(fetched.faults) - MAX_LISTED_FAULTS} more pictures cannot be used")
    for line in fetched.lines():
        print_line(line)
    if fetched.manual_entry:
        print_notice(f"write into the block file: {fetched.manual_entry}")
    if fetched.missing:
        print_notice(f"{format_count(fetched.missing, 'picture')} could not be fetched; run the same command again")
        sys.exit(1)
