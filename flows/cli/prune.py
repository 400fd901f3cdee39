"""Command that removes old snapshots."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from flows.cli.output import print_line, print_notice
from flows.cli.paths import EXISTING_OUT

if TYPE_CHECKING:
    from catalogs.published.folders import Folder


@click.command(short_help="Remove old published snapshots.")
@click.argument("out", metavar="OUT", type=EXISTING_OUT)
@click.option(
    "--keep", type=click.IntRange(1), required=True, metavar="N", help="Number of published snapshots to keep."
)
def prune(out: Folder, keep: int) -> None:
    """Remove all but the N newest published snapshots of the run in OUT, or of each run below it.

    Also removes files of killed runs. Keeps the `current` snapshot, snapshots in use, and in a bucket snapshots
    superseded within the last hour. `streetloom run --keep N` does the same after each run.

    \b
    Example:
      streetloom prune out/mine --keep 7
    """
    from catalogs.published.runs import find_runs
    from flows.lock import lock_folder
    from tasks.publish.prune import prune_snapshots as remove

    runs, left_out = find_runs(out)
    for run in runs:
        with lock_folder(run.folder):
            for line in remove(run.folder, keep):
                print_line(line)
    for line in left_out:
        print_notice(line)
