"""Output of a run in a terminal: progress bars on stderr and a summary; elsewhere one line per tenth."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import timedelta

from rich.console import Console
from rich.text import Text

from catalogs.printable_text import escape_invisible, format_command, format_count
from facade_core.core.json_types import JsonObject
from facade_core.imagery.detect.models import INSTALL_COMMAND
from tasks.engine.progress import StageProgress

console = Console(stderr=True)


def print_status(line: str) -> None:
    """Print a line above the progress bars."""
    _print_escaped(console, f"streetloom: {line}")


@dataclass
class ProgressLines:
    """Progress events as lines: start of a stage, each tenth with the remaining time, and its end.

    The time that is left is stated once a tenth is done, and marked as revised where the whole grows by half.

    Attributes
    ----------
    clock : current time in seconds.
    """

    clock: Callable[[], float] = time.monotonic
    _begun: dict[str, float] = field(default_factory=dict)
    _newest: dict[str, StageProgress] = field(default_factory=dict)
    _ended: tuple[str, float] = ("", 0.0)
    _expected: dict[str, float] = field(default_factory=dict)

    def update(self, event: StageProgress) -> str | None:
        """Return the line of an event, None between two tenths."""
        before = self._newest.get(event.stage)
        if before and (event.finished < before.finished or event.total != before.total):  # the stage has begun again
            before = None
        if before is None:
            self._begun[event.stage] = self.clock()
            self._expected.pop(event.stage, None)
        self._newest[event.stage] = event
        if event.finished >= event.total:
            self._ended = event.stage, self.clock()
        if before is None:
            earlier = f", {event.earlier} of them done before" if event.earlier else ""
            return f"{event.stage}: {event.total}{earlier}"
        if _count_tenths(event) <= _count_tenths(before):
            return None
        return self._describe(event)

    def describe(self) -> str:
        """Format the present counts and times of all stages that have begun and not ended."""
        running = [
            self._describe(event, repeated=True) for event in [*self._newest.values()] if event.finished < event.total
        ]
        if running:
            return "; ".join(running)
        stage, ended = self._ended
        return f"{stage}: done; on the next step for {_format_clock(self.clock() - ended)}"

    def _describe(self, event: StageProgress, *, repeated: bool = False) -> str:
        seconds, done = self.clock() - self._begun[event.stage], event.finished - event.earlier
        parts = [f"{event.stage}: {event.finished} of {event.total}"]
        if event.failed:
            parts.append(f"{event.failed} failed")
        if repeated:
            parts.append(f"{_format_clock(seconds)} so far")
        if event.finished >= event.total:
            if event.earlier:
                parts.append(f"{event.earlier} of them done before")
            parts.append(f"in {format_duration(seconds)}")
        elif 10 * done >= event.total - event.earlier:  # units of this run only; those of earlier runs took no time
            whole = seconds * (event.total - event.earlier) / done
            told = self._expected.get(event.stage, whole)
            revised = "revised: " if whole > 1.5 * told else ""
            self._expected[event.stage] = whole if revised else min(whole, told)
            parts.append(f"{revised}about {format_duration(whole - seconds)} left")
        return ", ".join(parts)


def _count_tenths(event: StageProgress) -> int:
    return 10 * event.finished // event.total if event.total else 10


def _format_clock(seconds: float) -> str:
    """Format seconds such as "0:02:20", in which every repetition differs."""
    return str(timedelta(seconds=round(seconds)))


def format_duration(seconds: float) -> str:
    """Format seconds such as "40 s", "12 min" or "3 h 5 min"."""
    minutes = round(seconds / 60)
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def print_summary(target: Console, summary: JsonObject, *, is_painted: bool = False) -> None:
    """Print the summary of a run for people.

    Parameters
    ----------
    target : console to print to.
    summary : outcome of the run.
    is_painted : whether all pictures are painted and show no face or number plate.
    """
    done = f"{format_count(summary['facades_done'], 'facade')}"
    done += f" in {summary['seconds']:.0f} s, {format_count(summary['units_skipped'], 'unit')} done before"
    _print_escaped(target, (summary["block"], "bold"), f": {done}")
    for key, word in (("failures", ("failed", "red")), ("refused", ("refused", "yellow"))):
        for one in summary[key]:
            _print_escaped(target, "  ", word, f" {one['unit']}: {one['reason']}")
    if (unchecked := summary["not_looked_at"]) and not is_painted:
        counted = f"facades and exemplars from pictures not checked for faces and number plates: {unchecked}"
        _print_escaped(target, f"  {counted}; {INSTALL_COMMAND} installs the detectors")
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
