"""Output of a run in a terminal: progress bars on stderr and a summary; elsewhere one line per tenth."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

from rich.console import Console
from rich.text import Text

from catalogs.printable_text import escape_invisible, format_command, format_count
from facade_core.core.json_types import JsonObject
from tasks.engine.progress import StageProgress

console = Console(stderr=True)


def print_status(line: str) -> None:
    """Print a line above the progress bars."""
    _print_escaped(console, f"streetloom: {line}")


@dataclass
class ProgressLines:
    """Print progress events as lines: start of a stage, each tenth with the remaining time, and its end.

    Attributes
    ----------
    tell : receives each line.
    clock : current time in seconds.
    """

    tell: Callable[[str], None]
    clock: Callable[[], float] = time.monotonic
    _begun: dict[str, float] = field(default_factory=dict)
    _tenths: dict[str, int] = field(default_factory=dict)

    def __call__(self, event: StageProgress) -> None:
        stage, finished, total = event.stage, event.finished, event.total
        tenth = 10 * finished // total if total else 10
        if stage not in self._begun:
            self._begun[stage] = self.clock()
            self._tenths[stage] = tenth
            before = f", {event.earlier} of them done before" if event.earlier else ""
            self.tell(f"{stage}: {total}{before}")
            return
        if tenth <= self._tenths[stage]:
            return
        self._tenths[stage] = tenth
        seconds = self.clock() - self._begun[stage]
        # estimate from units of this run only; finished units of earlier runs took no time
        left = seconds * (total - finished) / max(finished - event.earlier, 1)
        when = f"about {format_duration(left)} left" if finished < total else f"in {format_duration(seconds)}"
        failures = f", {event.failed} failed" if event.failed else ""
        self.tell(f"{stage}: {finished} of {total}{failures}, {when}")


def format_duration(seconds: float) -> str:
    """Format seconds such as "40 s", "12 min" or "3 h 5 min"."""
    minutes = round(seconds / 60)
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def print_summary(target: Console, summary: JsonObject, *, painted: bool = False) -> None:
    """Print the summary of a run for people.

    Parameters
    ----------
    target : console to print to.
    summary : outcome of the run.
    painted : the pictures are painted, so that no face or number plate can be missed.
    """
    done = f"{format_count(summary['facades_done'], 'facade')}, {format_count(summary['viewpoints'], 'viewpoint')}"
    done += f" in {summary['seconds']:.0f} s, {format_count(summary['units_skipped'], 'unit')} done before"
    _print_escaped(target, (summary["block"], "bold"), f": {done}")
    for failure in summary["failures"]:
        _print_escaped(target, "  ", ("failed", "red"), f" {failure['unit']}: {failure['reason']}")
    if summary["not_looked_at"] and not painted:
        unseen = f"{summary['not_looked_at']} facades and exemplars were made of pictures"
        _print_escaped(
            target, f"  {unseen} in which faces and plates were not looked for; `make detect-setup` installs what does"
        )
    _print_escaped(target, f"  report  {summary['outputs']['report']}")
    for model in summary["outputs"]["glb"]:
        _print_escaped(target, f"  model   {model}")
    _print_escaped(target, f"  items   {summary['outputs']['items']}")
    _print_escaped(target, f"  look    {format_command('view', summary['out'])}")


def _print_escaped(target: Console, *parts: str | tuple[str, str]) -> None:
    """Print one line of styled parts, without interpretation of markup or control characters."""
    shown = [
        escape_invisible(part) if isinstance(part, str) else (escape_invisible(part[0]), part[1]) for part in parts
    ]
    target.print(Text.assemble(*shown), soft_wrap=True)
