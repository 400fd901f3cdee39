"""What a run looks like in a terminal: progress bars on stderr, a summary at the end. Elsewhere: a line for each tenth."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.text import Text

from catalogs.printable_text import escape_invisible
from tasks.engine.progress import StageProgress, add_listener

console = Console(stderr=True)


@contextmanager
def show_progress(*, quiet: bool = False) -> Iterator[None]:
    """Show the tasks' events until the block ends: a bar per stage in a terminal, else lines."""
    if quiet:
        yield
        return
    if not console.is_terminal:
        stop = add_listener(ProgressLines(print_status))
        try:
            yield
        finally:
            stop()
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

        def on_event(told: StageProgress) -> None:
            if told.stage not in bars:
                bars[told.stage] = display.add_task(told.stage, total=told.total, failed="")
            failed = f"{told.failed} failed" if told.failed else ""
            display.update(bars[told.stage], completed=told.finished, total=told.total, failed=failed)

        stop = add_listener(on_event)
        try:
            yield
        finally:
            stop()


def print_status(line: str) -> None:
    """A line beside the bars."""
    _print_escaped(console, f"streetloom: {line}")


@dataclass
class ProgressLines:
    """Tells events in lines: a stage that begins, each tenth of it with the time that is left, and its end."""

    tell: Callable[[str], None]
    clock: Callable[[], float] = time.monotonic
    _begun: dict[str, float] = field(default_factory=dict)
    _tenths: dict[str, int] = field(default_factory=dict)

    def __call__(self, told: StageProgress) -> None:
        stage, finished, total = told.stage, told.finished, told.total
        tenth = 10 * finished // total if total else 10
        if stage not in self._begun:
            self._begun[stage] = self.clock()
            self._tenths[stage] = tenth
            before = f", {told.earlier} of them done before" if told.earlier else ""
            self.tell(f"{stage}: {total}{before}")
            return
        if tenth <= self._tenths[stage]:
            return
        self._tenths[stage] = tenth
        seconds = self.clock() - self._begun[stage]
        # by what this run did: what is found done takes no time
        left = seconds * (total - finished) / max(finished - told.earlier, 1)
        when = f"about {_format_duration(left)} left" if finished < total else f"in {_format_duration(seconds)}"
        aside = f", {told.failed} failed" if told.failed else ""
        self.tell(f"{stage}: {finished} of {total}{aside}, {when}")


def _format_duration(seconds: float) -> str:
    """Such as "40 s", "12 min" or "3 h 5 min"."""
    minutes = round(seconds / 60)
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def print_summary(target: Console, summary: dict[str, Any], *, painted: bool = False) -> None:
    """The summary of a run for people. painted: its pictures are painted, with no face or plate to look for."""
    done = f"{summary['facades_done']} facades, {summary['viewpoints']} viewpoints in {summary['seconds']:.0f} s"
    _print_escaped(target, (summary["block"], "bold"), f": {done}, {summary['units_skipped']} units were done before")
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
    _print_escaped(target, f"  look    streetloom view {summary['out']}")


def _print_escaped(target: Console, *parts: str | tuple[str, str]) -> None:
    """One line of text, parts of it in a style; nothing in it is taken for markup or steers the terminal."""
    shown = [escape_invisible(part) if isinstance(part, str) else (escape_invisible(part[0]), part[1]) for part in parts]
    target.print(Text.assemble(*shown), soft_wrap=True)
