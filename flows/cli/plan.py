"""Command that estimates the cost of a city or block."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from flows.cli.output import print_line
from flows.cli.paths import EXISTING_FILE, EXISTING_FOLDER

if TYPE_CHECKING:
    from facade_core.core.json_types import JsonObject
    from tasks.city.estimated_counts import EstimatedCounts


@click.command("plan", short_help="Estimate the cost of a block or a city.")
@click.argument("city_file", metavar="CITY.yaml", type=EXISTING_FILE)
@click.option(
    "--at-once", default=2, show_default=True, type=click.IntRange(1, 10_000), help="Number of concurrent blocks."
)
@click.option("--workers", default=2, show_default=True, type=click.IntRange(1, 256), help="Number of local processes.")
@click.option("--json", "as_json", is_flag=True, help="Print a JSON object.")
@click.option(
    "--out", type=EXISTING_FOLDER, help="Folder of an earlier run of the block: say what a run would change there."
)
def plan_command(city_file: Path, at_once: int, workers: int, as_json: bool, out: Path | None) -> None:
    """Estimate the cost of a city, of a city of block files, or of a block file, before its first run.

    With --out, say what a run of a block file would do again after changes; nothing is changed.

    Counts the whole map, and corrects the counts by a sample of parts that are planned as a run plans them.

    \b
    Examples:
      streetloom plan helsinki.yaml --at-once 4 --workers 8
      streetloom plan block.yaml
      streetloom plan block.yaml --out out/block
    """
    if out:
        _print_changes(city_file, out, as_json)
        return
    from flows.step_reporter import report_steps
    from tasks.city.cost import load_cost_model
    from tasks.city.estimated_counts import estimate_counts

    with report_steps() as notify:
        counts = estimate_counts(city_file, notify)
    estimate = load_cost_model().estimate(counts.blocks, workers, at_once, margin_s=counts.margin_s)
    estimate |= {"planned_parts": counts.planned, "parts": counts.parts}
    if as_json:
        click.echo(json.dumps(estimate))
        return
    for line in _describe_estimate(counts, estimate, workers, at_once):
        print_line(line)


def _print_changes(block_file: Path, out: Path, as_json: bool) -> None:
    from catalogs.block.reader import read_block
    from flows.step_reporter import report_steps
    from tasks.doctor.folder import forecast_changes

    with report_steps():
        said = forecast_changes(read_block(block_file), out)
    said = said or "everything is pending: no run finished there"
    print_line(json.dumps({"pending": said}) if as_json else said)


def _describe_estimate(counts: EstimatedCounts, estimate: JsonObject, workers: int, at_once: int) -> list[str]:
    """Return the lines of an estimate, one for each fact."""
    from catalogs.printable_text import format_count
    from flows.console import format_duration

    def describe_time(quantity: str) -> str:
        middle, low, high = (format_duration(3600 * estimate[f"{quantity}{end}"]) for end in ("", "_low", "_high"))
        return f"{middle} ({low} to {high})"

    names = {
        "facades": "facades",
        "viewpoints": "viewpoints",
        "ground": "pieces of ground",
        "exemplars": "exemplars",
        "photos": "photos",
        "panoramas": "panoramas",
    }
    found = ", ".join(f"{estimate[name]:,} {text}" for name, text in names.items() if estimate[name])
    where = format_count(workers, "worker")
    if counts.is_city:
        where = f"{format_count(estimate['workers'], 'worker')}, {format_count(at_once, 'block')} at a time"
    fitted = estimate["fitted"]
    densities = ", ".join(f"{density:g}" for density in fitted["texels_per_metre"])
    size = format_count(estimate["blocks"], "block") if counts.is_city else "one block"
    return [
        f"{counts.name}: {size}, about {found}",
        *([f"  place      {counts.place}", f"  heights    {counts.heights}"] if counts.place else []),
        f"  time       {describe_time('hours')} with {where}",
        f"  processor  {describe_time('processor_hours')} of one processor",
        f"  disk       {estimate['gigabytes']:.2g} GB, {estimate['commits']:,} commits",
        f"  bottleneck {estimate['bottleneck']}: {estimate['bottleneck_share']:.0%} of the time",
        f"  sample     {counts.planned} of {counts.parts} {'block files' if counts.parts_are_files else 'parts'} planned",
        f"  model      fitted {fitted['on']} on {fitted['machine']}, {fitted['facades']} facades, {densities} texels a metre",
        f"  interval   errors of the sample and of the model, at most {fitted['error_planned']['seconds']:.0%} of the "
        "seconds of blocks outside its fit; times are of otherwise idle processors",
    ]
