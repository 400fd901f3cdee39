"""Command that exports metrics of runs to a monitoring system."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from flows.cli.output import print_line, print_notice
from flows.cli.paths import EXISTING_OUT

if TYPE_CHECKING:
    from catalogs.published.folders import Folder


@click.command(short_help="Print metrics in the Prometheus text format.")
@click.argument("out", metavar="OUT", type=EXISTING_OUT)
@click.option("--otlp", metavar="URL", help="Send the metrics to this OpenTelemetry collector over HTTP instead.")
def metrics(out: Folder, otlp: str | None) -> None:
    """Print metrics of a run, or of all runs below OUT, in the text format of Prometheus.

    Units by stage and state, seconds, commits, bytes of the store.

    \b
    Examples, the first for node_exporter's textfile collector:
      streetloom metrics out > /var/lib/node_exporter/streetloom.prom.tmp && mv /var/lib/node_exporter/streetloom.prom{.tmp,}
      streetloom metrics out --otlp http://127.0.0.1:4318
    """
    from prometheus_client import generate_latest

    from catalogs.imagery.http_client import redact_url
    from catalogs.published.runs import find_runs_with_store, publish_hint
    from facade_core.core.errors import InputError
    from tasks.metrics import collect_metrics

    if not (runs := find_runs_with_store(out)):
        raise InputError(f"{out}: holds no run; {publish_hint(out, 'makes one')}")
    registry, left_out = collect_metrics(runs)
    for line in left_out:
        print_notice(line)
    if otlp is None:
        click.echo(generate_latest(registry).decode(), nl=False)
        return
    try:
        from tasks.otlp import send_metrics
    except ModuleNotFoundError as error:
        raise InputError(f"--otlp needs {error.name}; install it with: pip install 'streetloom[otlp]'") from error
    count_runs = len(runs) - len(left_out)
    count = send_metrics(registry, otlp)
    print_line(f"{redact_url(otlp)}: took {count} values of {count_runs} run{'s' if count_runs > 1 else ''}")
