"""Progress events: tasks report finished units, listeners receive them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from threading import Lock


@dataclass(frozen=True)
class StageProgress:
    """Progress of a stage.

    Attributes
    ----------
    finished : units that are done or failed, in this run or before it.
    total : number of units.
    failed : units that failed in this run.
    earlier : units that an earlier run finished.
    """

    stage: str
    finished: int
    total: int
    failed: int = 0
    earlier: int = 0


Listener = Callable[[StageProgress], None]

_listeners: list[Listener] = []
_stages: dict[str, StageProgress] = {}
_lock = Lock()


def add_listener(listener: Listener) -> Callable[[], None]:
    """Call `listener` at every event until the returned function is called."""
    _listeners.append(listener)
    return lambda: _listeners.remove(listener)


def begin_stage(stage: str, total: int, earlier: int = 0) -> None:
    """Announce a stage of `total` units, of which an earlier run finished `earlier`."""
    with _lock:
        _notify(StageProgress(stage, earlier, total, earlier=earlier))


def report_progress(stage: str, finished: int = 0, failed: int = 0, *, earlier: int = 0) -> None:
    """Add finished, failed and earlier units to a stage; callable from any thread."""
    with _lock:
        before = _stages.get(stage) or StageProgress(stage, 0, 0)
        _notify(
            replace(
                before,
                finished=before.finished + finished + earlier,
                failed=before.failed + failed,
                earlier=before.earlier + earlier,
            )
        )


def _notify(progress: StageProgress) -> None:
    _stages[progress.stage] = progress
    for listener in _listeners:
        listener(progress)
