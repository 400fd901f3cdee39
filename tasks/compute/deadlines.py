"""How long a unit may take, by what others of its stage took in this run."""

from __future__ import annotations

from collections import defaultdict, deque
from statistics import median
from threading import Lock

# Times the median of its stage that a unit may take, in seconds at least, and in seconds before a median is known.
TIMES, LEAST_S, FIRST_S = 20, 600.0, 3600.0
# Units that make a median, and as many as are remembered.
ENOUGH, REMEMBERED = 3, 500


class Deadlines:
    """What the units of each stage took, and how long the next one may; from any thread."""

    def __init__(self) -> None:
        self._took: defaultdict[str, deque[float]] = defaultdict(lambda: deque(maxlen=REMEMBERED))
        self._lock = Lock()

    def note(self, stage: str, seconds: float) -> None:
        """A unit of a stage took so long."""
        with self._lock:
            self._took[stage].append(seconds)

    def of(self, stage: str) -> float:
        """Seconds that a unit of a stage may run before it is tried elsewhere too."""
        with self._lock:
            took = self._took[stage]
            return max(LEAST_S, TIMES * median(took)) if len(took) >= ENOUGH else FIRST_S
