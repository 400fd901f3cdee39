"""Lines on stderr for work without countable units: each step as it begins, and again while it lasts."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from flows.console import format_duration, print_status

# Longest silence in seconds.
REPORT_INTERVAL_S = 20.0


@contextmanager
def report_steps(
    tell: Callable[[str], None] = print_status, interval: float = REPORT_INTERVAL_S, *, announce: bool = True
) -> Iterator[Callable[[str], None]]:
    """Print each step, and how long it lasts after every `interval` seconds without a line.

    Parameters
    ----------
    tell : receives each line.
    interval : seconds.
    announce : False to print only steps that last longer than `interval`.

    Yields
    ------
    notify : begins a step.
    """
    steps = _Steps(tell, announce)
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

    def __init__(self, tell: Callable[[str], None], announce: bool) -> None:
        self._tell, self._announce, self._lock = tell, announce, threading.Lock()
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
                self._tell(f"{self._step}: {format_duration(time.monotonic() - self._begun)} so far")
            if time.monotonic() - self.told >= interval:
                self.told = time.monotonic()
