"""Command that completes the layout of one facade."""

from __future__ import annotations

import json
from pathlib import Path

import click

from flows.cli.output import print_line
from flows.cli.paths import EXISTING_FILE, FOLDER


@click.command("complete", short_help="Complete the layout of a facade, in several ways.")
@click.argument("file", metavar="IMAGE|JSON", type=EXISTING_FILE)
@click.option("--n", "count", type=click.IntRange(1, 32), default=5, show_default=True, help="Number of completions.")
@click.option("--to", "pictures", type=FOLDER, help="Folder for a picture of each completion.")
def complete_command(file: Path, count: int, pictures: Path | None) -> None:
    """Complete the layout of a rectified picture of a facade, or of a partly observed layout, and print ranked JSON.

    Transparent pixels of a picture are hidden; occluders are found. A JSON file has width, height, objects with label, x0,
    y0, x1 and y1, and visible, the boxes of the part that is seen. In the pictures, seen elements are outlined and added
    ones are filled.

    \b
    Examples:
      streetloom complete facade.png --n 5 --to completions/
      streetloom complete layout.json --n 3
    """
    from tasks.ranked_completions import complete_file

    print_line(json.dumps(complete_file(file, count, pictures)))
