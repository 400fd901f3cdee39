"""The command that tells a monitoring system what lies in runs' stores."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from flows.cli.paths import EXISTING_OUT

if TYPE_CHECKING:
    from catalogs.published.places import Folder


@click.command()
@click.argument("out", metavar="OUT", type=EXISTING_OUT)
def metrics(out: Folder) -> None:
    """Print metrics of a run, or of all runs below OUT, in Prometheus' text format.

    Units by stage and state, seconds, commits, bytes of the store.

    \b
    Example, for node_exporter's textfile collector:
      streetloom metrics out > /var/lib/node_exporter/streetloom.prom.tmp && mv /var/lib/node_exporter/streetloom.prom{.tmp,}
    """
    from catalogs.published.runs import stores_in
    from facade_core.errors import InputError
    from tasks.metrics import exposition

    if not (runs := stores_in(out)):
        raise InputError(f"{out}: holds no run; `streetloom run BLOCK.yaml --out {out}` makes one")
    click.echo(exposition(runs), nl=False)
