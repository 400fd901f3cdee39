"""Submission of Prefect tasks: with a record in Prefect's server, or as functions in a pool of threads."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from queue import SimpleQueue
from typing import Protocol, TypeVar

from prefect import Task

K = TypeVar("K")
R = TypeVar("R")
R_co = TypeVar("R_co", covariant=True)


class TaskFuture(Protocol[R_co]):
    """Protocol of the future of a task, in Prefect or in a pool."""

    def result(self) -> R_co:
        """Wait for the result of the task, or raise its error."""
        ...

    def add_done_callback(self, fn: Callable[[TaskFuture[R_co]], None], /) -> None:
        """Call a function with the future once the task has ended."""
        ...


class Submit(Protocol):
    """Starts a task, under a name of its own if one is given."""

    def __call__(self, task: Task[..., R], *arguments: object, name: str | None = None) -> TaskFuture[R]: ...


def queue_end(ended: SimpleQueue[tuple[K, TaskFuture[R]]], key: K, future: TaskFuture[R]) -> None:
    """Put a future with a key into a queue once its task has ended."""
    future.add_done_callback(lambda done: ended.put((key, done)))


def submit_to_prefect(task: Task[..., R], *arguments: object, name: str | None = None) -> TaskFuture[R]:
    """Start a task that Prefect records."""
    return (task.with_options(name=name) if name else task).submit(*arguments)


def submit_to_pool(pool: ThreadPoolExecutor) -> Submit:
    """Return a function that starts tasks in a pool, without a record."""

    def submit(task: Task[..., R], *arguments: object, name: str | None = None) -> TaskFuture[R]:
        return pool.submit(task.fn, *arguments)

    return submit
