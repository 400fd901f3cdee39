"""Deadlines of units, by the durations of other units of their stage in this run."""

from __future__ import annotations

from collections import defaultdict, deque
from statistics import median
from threading import Lock

from tasks.engine.compute.timeouts import Timeouts

# Times the median of its stage that a unit may take.
MAX_MEDIAN_FACTOR = 20
# Units that make a median, and as many as are remembered.
MIN_UNITS_FOR_MEDIAN, MAX_REMEMBERED = 3, 500


class Deadlines:
    """Durations of the units of each stage, and the limit of the next one; callable from any thread."""

    def __init__(self, patience: Timeouts) -> None:
        self._patience = patience
        self._took: defaultdict[str, deque[float]] = defaultdict(lambda: deque(maxlen=MAX_REMEMBERED))
        self._lock = Lock()

    def record(self, stage: str, seconds: float) -> None:
        """Record the duration of a unit of a stage."""
        with self._lock:
            self._took[stage].append(seconds)

    def limit(self, stage: str) -> float:
        """Return the seconds that a unit of a stage may run before it is tried elsewhere too."""
        with self._lock:
            took = self._took[stage]
            if len(took) < MIN_UNITS_FOR_MEDIAN:
                return self._patience.unit_first
            return max(self._patience.unit_least, MAX_MEDIAN_FACTOR * median(took))
