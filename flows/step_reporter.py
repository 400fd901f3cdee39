"""Progress on stderr: bars or lines of stages, and lines of steps without countable units, repeated while they last."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TaskID, TextColumn, TimeElapsedColumn

from flows.console import ProgressLines, console, format_duration, print_status
from tasks.engine.progress import StageProgress, add_listener

# Longest silence in seconds.
REPORT_INTERVAL_S = 10.0


@contextmanager
def show_progress(*, quiet: bool = False) -> Iterator[None]:
    """Show the progress events of tasks until the block ends: a bar per stage in a terminal, else lines.

    Present counts follow where no line does, as during a long unit.
    """
    if quiet:
        yield
        return
    if not console.is_terminal:
        lines = ProgressLines()
        with report_steps(describe=lambda step, seconds: lines.describe()) as notify:

            def print_line(event: StageProgress) -> None:
                if line := lines.update(event):
                    notify(line)

            stop = add_listener(print_line)
            try:
                yield
            finally:
                stop()
        return
    bars: dict[str, TaskID] = {}
    with Progress(
        SpinnerColumn(),
        TextColumn("{task.description:<12}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("[red]{task.fields[failed]}"),
        console=console,
    ) as display:

        def on_event(event: StageProgress) -> None:
            if event.stage not in bars:
                bars[event.stage] = display.add_task(event.stage, total=event.total, failed="")
            failed = f"{event.failed} failed" if event.failed else ""
            display.update(bars[event.stage], completed=event.finished, total=event.total, failed=failed)

        stop = add_listener(on_event)
        try:
            yield
        finally:
            stop()


def _describe_step(step: str, seconds: float) -> str:
    return f"{step}: {format_duration(seconds)} so far"


@contextmanager
def report_steps(
    tell: Callable[[str], None] = print_status,
    interval: float = REPORT_INTERVAL_S,
    *,
    announce: bool = True,
    describe: Callable[[str, float], str] = _describe_step,
) -> Iterator[Callable[[str], None]]:
    """Print each step, and how long it lasts after every `interval` seconds without a line.

    Parameters
    ----------
    tell : receives each line.
    interval : seconds.
    announce : False to print only steps that last longer than `interval`.
    describe : formats the line of a step that lasts, from the step and its seconds.

    Yields
    ------
    notify : begins a step.
    """
    steps = _Steps(tell, announce, describe)
    over = threading.Event()

    def repeat() -> None:
        while not over.wait(max(0.0, steps.told + interval - time.monotonic())):
            steps.repeat(interval)

    thread = threading.Thread(target=repeat, name="steps", daemon=True)
    thread.start()
    try:
        yield steps.begin
    finally:
        over.set()
        thread.join()


class _Steps:
    """Present step, and when it and the last line began."""

    def __init__(self, tell: Callable[[str], None], announce: bool, describe: Callable[[str, float], str]) -> None:
        self._tell, self._announce, self._lock = tell, announce, threading.Lock()
        self._describe = describe
        self._step, self._begun = "", time.monotonic()
        self.told = self._begun

    def begin(self, step: str) -> None:
        """Begin a new step, and print it unless only long ones are printed."""
        with self._lock:
            self._step, self._begun = step, time.monotonic()
            self.told = self._begun
            if self._announce:
                self._tell(step)

    def repeat(self, interval: float) -> None:
        """Print the step again, with its seconds, unless a line was printed within `interval` seconds."""
        with self._lock:
            if self._step and time.monotonic() - self.told >= interval:
                self._tell(self._describe(self._step, time.monotonic() - self._begun))
            if time.monotonic() - self.told >= interval:
                self.told = time.monotonic()
