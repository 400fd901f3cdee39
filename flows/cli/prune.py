"""The command that removes what older snapshots left."""

from __future__ import annotations

from pathlib import Path

import click

from flows.cli.paths import EXISTING_FOLDER
from flows.cli.say import say


@click.command()
@click.argument("out", metavar="OUT", type=EXISTING_FOLDER)
@click.option("--keep", type=click.IntRange(1), required=True, metavar="N", help="Published snapshots to keep.")
def prune(out: Path, keep: int) -> None:
    """Remove all but the N newest published snapshots of the run in OUT, and what only they and killed runs left.

    What `current` names is kept, and what somebody reads. `streetloom run --keep N` does the same after each run.

    \b
    Example:
      streetloom prune out/mine --keep 7
    """
    from flows.lock import locked
    from tasks.published.prune import prune as remove

    with locked(out):
        for line in remove(out, keep):
            say(line)
