"""Execution of units in this process, one at a time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

from facade_core.core.errors import MachineError
from tasks.engine.compute.cluster import RUN_TIMEOUT_MESSAGE, UNITS_SHARE, RunTimeoutError, SubmittedUnit
from tasks.engine.compute.worker_setup import run_unit

R = TypeVar("R")
R_co = TypeVar("R_co", covariant=True)


@dataclass(frozen=True, eq=False)
class DeferredUnit(Generic[R_co]):
    """A unit that runs when its result is asked for."""

    function: Callable[..., R_co]
    arguments: tuple[object, ...]
    serial: SerialCompute

    def result(self) -> R_co:
        """Run the unit in this process and return its result."""
        with self.serial.lock:
            self.serial.require_open()
            return run_unit(self.function, *self.arguments)


class SerialCompute:
    """Runs each unit in this process, one at a time, when its result is requested."""

    threads = 1

    def __init__(self, until: float | None = None) -> None:
        import psutil

        self._until = until
        self.memory = int(psutil.virtual_memory().available * UNITS_SHARE)
        self.lock = threading.RLock()
        self._open = True

    def submit(self, function: Callable[..., R], *args: object, memory: int = 0) -> DeferredUnit[R]:
        """Defer a unit until its result is requested; `memory` has no effect."""
        if self._until is not None and time.monotonic() > self._until:
            raise RunTimeoutError(RUN_TIMEOUT_MESSAGE)
        return DeferredUnit(function, args, self)

    def iterate_completed(self, started: Iterable[SubmittedUnit[R]]) -> Iterator[SubmittedUnit[R]]:
        """Iterate over the units in order.

        No other starts until the next is requested: each is committed before the next one.
        """
        for unit in started:
            with self.lock:
                yield unit

    def close(self) -> None:
        """Start no more units: the run ends, and its threads may still wait for their turn."""
        self._open = False

    def require_open(self) -> None:
        """Raise MachineError if the run has ended."""
        if not self._open:
            raise MachineError("the run has ended")
