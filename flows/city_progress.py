"""Progress of a city between the ends of its blocks."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from catalogs.published.folders import Folder
from flows.city_options import CityOptions
from flows.console import format_duration
from tasks.city.block_process import block_output_path
from tasks.city.city_log import CityLog
from tasks.engine.commands import read_newest_line

# Longest silence in seconds.
PROGRESS_INTERVAL_S = 20.0
# Running blocks that a line names.
MAX_NAMED_BLOCKS = 3


@dataclass
class CityProgress:
    """What runs, what is done and the time that is left.

    Attributes
    ----------
    out : folder of the city.
    log : state of the blocks.
    due : blocks of this run.
    options : options of the run.
    running : blocks that run now.
    clock : present time in seconds.
    """

    out: Folder
    log: CityLog
    due: Sequence[str]
    options: CityOptions
    running: list[str] = field(default_factory=list)
    clock: Callable[[], float] = time.monotonic
    _ended: list[str] = field(default_factory=list)
    _begun: float = 0.0
    _pace: float = 1.0

    def __post_init__(self) -> None:
        self._begun = self.clock()

    def end_block(self, name: str, log: CityLog) -> None:
        """Record the end of a block; the pace follows from the estimate of all that have ended."""
        self.running.remove(name)
        self.log = log
        self._ended.append(name)
        if estimated := self._estimate_s(self._ended):
            self._pace = (self.clock() - self._begun) / estimated

    def describe(self) -> str:
        """Format the progress in one line."""
        summaries = [self.log.blocks[name].summary for name in self._ended]
        done = sum(int(summary.get("facades_done", 0)) for summary in summaries)
        total = self.log.estimate(self.due, self.options.workers, self.options.at_once)["facades"]
        left = max(self._pace * self._estimate_s(self.due) - (self.clock() - self._begun), 0.0)
        told = f", about {format_duration(left)} left" if 10 * len(self._ended) >= len(self.due) else ""
        running = "; ".join(self._describe_block(name) for name in self.running[:MAX_NAMED_BLOCKS])
        more = len(self.running) - MAX_NAMED_BLOCKS
        others = f"; {more} more" if more > 0 else ""
        counts = f"{len(self._ended)} of {len(self.due)} blocks, {done:,} of about {total:,} facades done"
        return f"{counts}{told}; running {running}{others}"

    def _describe_block(self, name: str) -> str:
        line = read_newest_line(block_output_path(self.out, name))
        return f"{name} ({line})" if line else name

    def _estimate_s(self, names: Sequence[str]) -> float:
        hours: float = self.log.estimate(names, self.options.workers, self.options.at_once)["hours"]
        return 3600 * hours
