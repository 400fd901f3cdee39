"""Progress events of trainings in tests."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from tasks.engine.progress import StageProgress, add_listener


@contextmanager
def listening(listener: Callable[[StageProgress], None]) -> Iterator[None]:
    stop = add_listener(listener)
    try:
        yield
    finally:
        stop()


def interrupt_at(finished: int) -> Callable[[StageProgress], None]:
    """Interrupt a training, as Ctrl+C does, once so many units are finished."""

    def interrupt(event: StageProgress) -> None:
        if event.finished == finished:
            raise KeyboardInterrupt

    return interrupt
