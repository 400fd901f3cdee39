"""Progress as events: tasks say what they finished, whoever watches listens."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from threading import Lock

# (stage, units finished, units in all, failed)
Listener = Callable[[str, int, int, int], None]

_listeners: list[Listener] = []
_finished: Counter[str] = Counter()
_failed: Counter[str] = Counter()
_total: dict[str, int] = {}
_lock = Lock()


def listen(listener: Listener) -> Callable[[], None]:
    """Call `listener` at every event until the returned function is called."""
    _listeners.append(listener)
    return lambda: _listeners.remove(listener)


def begin_stage(stage: str, total: int, finished: int = 0) -> None:
    """A stage of `total` units starts, of which so many were finished by an earlier run."""
    with _lock:
        _total[stage], _finished[stage], _failed[stage] = total, finished, 0
        _tell(stage)


def advance(stage: str, finished: int, failed: int = 0) -> None:
    """So many more units of a stage are finished, of which some failed. From any thread."""
    with _lock:
        _finished[stage] += finished
        _failed[stage] += failed
        _tell(stage)


def _tell(stage: str) -> None:
    for listener in _listeners:
        listener(stage, _finished[stage], _total.get(stage, 0), _failed[stage])
