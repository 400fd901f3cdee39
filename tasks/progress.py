"""Progress as events: tasks say what they finished, whoever watches listens."""

from __future__ import annotations

from collections.abc import Callable

# (stage, units finished, units in all, failed)
Listener = Callable[[str, int, int, int], None]

_listeners: list[Listener] = []


def listen(listener: Listener) -> Callable[[], None]:
    """Call `listener` at every event until the returned function is called."""
    _listeners.append(listener)
    return lambda: _listeners.remove(listener)


def report(stage: str, finished: int, total: int, failed: int = 0) -> None:
    for listener in _listeners:
        listener(stage, finished, total, failed)
