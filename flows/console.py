"""What a run looks like in a terminal: progress bars on stderr, a summary at the end."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from tasks.progress import listen

console = Console(stderr=True)


@contextmanager
def progress(*, quiet: bool) -> Iterator[None]:
    """Draw a bar per stage from the tasks' events, until the block ends."""
    if quiet:
        yield
        return
    bars: dict[str, Any] = {}
    with Progress(
        SpinnerColumn(),
        TextColumn("{task.description:<12}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("[red]{task.fields[failed]}"),
        console=console,
    ) as display:

        def on_event(stage: str, finished: int, total: int, failed: int) -> None:
            if stage not in bars:
                bars[stage] = display.add_task(stage, total=total, failed="")
            display.update(bars[stage], completed=finished, total=total, failed=f"{failed} failed" if failed else "")

        stop = listen(on_event)
        try:
            yield
        finally:
            stop()


def show(target: Console, summary: dict[str, Any]) -> None:
    """The summary of a run for people."""
    line = f"[bold]{summary['block']}[/bold]: {summary['facades_done']} facades, {summary['viewpoints']} viewpoints"
    target.print(f"{line} in {summary['seconds']:.0f} s, {summary['units_skipped']} units were done before")
    for failure in summary["failures"]:
        target.print(f"  [red]failed[/red] {failure['unit']}: {failure['reason']}", highlight=False, soft_wrap=True)
    target.print(f"  report  {summary['outputs']['report']}", highlight=False, soft_wrap=True)
    for model in summary["outputs"]["glb"]:
        target.print(f"  model   {model}", highlight=False, soft_wrap=True)
    target.print(f"  items   {summary['outputs']['items']}", highlight=False, soft_wrap=True)
    target.print(f"  look    streetloom view {summary['out']}", highlight=False, soft_wrap=True)
