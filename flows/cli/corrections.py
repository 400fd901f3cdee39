"""Command that imports corrections."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from flows.cli.output import print_line, print_notice
from flows.cli.paths import EXISTING, EXISTING_OUT
from flows.cli.usage import current_user

if TYPE_CHECKING:
    from catalogs.published.folders import Folder


@click.command("import", short_help="Import corrections from an edited export.")
@click.argument("folder", metavar="OUT", type=EXISTING_OUT)
@click.argument("path", metavar="FILE", type=EXISTING)
@click.option("--who", metavar="NAME", help="Author of the corrections.  [default: this user]")
@click.option("--why", metavar="TEXT", default="", help="Remark to store with the corrections.")
def import_(folder: Folder, path: Path, who: str | None, why: str) -> None:
    """Import corrections made in an export of OUT, a run or a city; the next run updates only the units that depend on them.

    FILE is a .json of COCO, a .json of LabelMe or a folder of them, a .gpkg (heights, levels, roofs and materials of its
    buildings, and the walls that are facades), CityJSON (the same as attributes), or {"corrections": [...]} as described
    in catalogs/README.md. Differences to the published data are stored next to the block file, or the city's, in
    NAME.corrections.jsonl: a line for each correction with who, when and why. The newest takes precedence; a value of null
    withdraws a correction.

    \b
    Examples:
      streetloom export out/demo --format labelme --to facades/    # correct boxes in LabelMe, then
      streetloom import out/demo facades/ --who anna --why "doors of the north side"
      streetloom import out/demo heights.gpkg
      streetloom import out/helsinki corrected.city.json
    """
    from tasks.corrections.correction_import import import_corrections

    done = import_corrections(folder, path, who=who or current_user(), why=why)
    for line in done.notes:
        print_notice(line)
    for line in done.lines():
        print_line(line)
