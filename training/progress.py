"""Progress of trainings, as stages of units."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TypeVar

from tasks.engine.progress import begin_stage, report_progress

Item = TypeVar("Item")


def track_progress(stage: str, items: Iterable[Item], total: int, *, earlier: int = 0) -> Iterator[Item]:
    """Yield items, and report each as a unit of a stage once the next one is asked for.

    Parameters
    ----------
    stage : name of the stage.
    items : items.
    total : number of units, those of earlier runs included.
    earlier : units that an earlier run finished.
    """
    begin_stage(stage, total, earlier=earlier)
    for item in items:
        yield item
        report_progress(stage, 1)
