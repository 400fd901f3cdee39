"""Command that harvests a style library from street pictures."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click

from flows.cli.output import print_line, print_notice
from flows.cli.paths import EXISTING, FOLDER
from tasks.harvest import MAX_EXEMPLARS, NOT_LOOKED_FOR, describe_weak_exemplars, note_few_exemplars

# Files without a picture that are listed one by one.
MAX_LISTED_FAULTS = 20


@click.command("harvest", short_help="Make a style library from street photos and panoramas.")
@click.argument("pictures", metavar="PICTURES...", type=EXISTING, nargs=-1, required=True)
@click.option("--out", type=FOLDER, required=True, help="Folder of the style library.")
@click.option(
    "--most",
    default=MAX_EXEMPLARS,
    show_default=True,
    type=click.IntRange(1),
    metavar="N",
    help="Maximum number of exemplars.",
)
@click.option("--licence", metavar="WORDS", help="Licence of pictures that state none, such as CC-BY-SA-4.0.")
@click.option("--workers", default=2, show_default=True, type=click.IntRange(1, 256), help="Number of local processes.")
def harvest(pictures: tuple[Path, ...], out: Path, most: int, licence: str | None, workers: int) -> None:
    """Make a style library of facades from street photos and panoramas. Their poses need not be known.

    The facades are rectified, cut, parsed and judged; the best become exemplars, each building once, for
    `imagery: {exemplars: {path: OUT}}` in a block file. Rejected facades are listed with their reasons in
    OUT/exemplars.json. OUT/harvest/sheets holds contact sheets of both. Resumable: a picture is harvested once.

    \b
    Examples:
      streetloom harvest my-photos/ --out style/
      streetloom harvest panoramas/ street.jpg --out style/ --most 60 --licence CC-BY-SA-4.0
    """
    from catalogs.printable_text import format_count
    from flows.cli.first_run import note_first_run
    from flows.cli.interrupts import exit_on_signal
    from flows.step_reporter import show_progress
    from tasks.harvest.library import harvest_style_library

    exit_on_signal()
    note_first_run()
    with show_progress(quiet=False):
        found = harvest_style_library(pictures, out, most=most, workers=workers, licence=licence)
    for fault in found.faults[:MAX_LISTED_FAULTS]:
        print_notice(f"{fault.id}: {fault.reason}")
    if len(found.faults) > MAX_LISTED_FAULTS:
        print_notice(f"{len(found.faults) - MAX_LISTED_FAULTS} more files cannot be read")
    if not found.looked:
        print_notice(NOT_LOOKED_FOR)
    if found.exemplars and (note := note_few_exemplars(len(found.exemplars))):
        print_notice(note)
    if found.weak:
        print_notice(describe_weak_exemplars(found.weak))
    print_line(f"pictures   {found.pictures}, {found.earlier} of them done before; {found.seconds:.1f} s each")
    print_line(
        f"exemplars  {len(found.exemplars)}; {format_count(len(found.rejected), 'facade')} rejected: {out / 'exemplars.json'}"
    )
    for sheet in found.sheets:
        print_line(f"sheet      {sheet}")
    if not found.exemplars:
        print_notice(
            f"{out}: no facade can be used; add photos taken from across the street, with a whole facade in view"
        )
        sys.exit(2)
    path = json.dumps(str(out.resolve()), ensure_ascii=False)
    print_line(f"ready: in the block file, under imagery, write exemplars: {{path: {path}}}")
