"""Submission of Prefect tasks: with a record in Prefect's server, or as functions in a pool of threads."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from queue import SimpleQueue
from typing import Protocol, TypeVar

from prefect import Task
from prefect.context import FlowRunContext
from prefect.utilities.annotations import quote

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


def is_recorded() -> bool:
    """Return True inside a flow run of Prefect, which records it."""
    return FlowRunContext.get() is not None


@contextmanager
def submit_tasks(threads: int) -> Iterator[Submit]:
    """Yield a function that starts tasks: recorded by Prefect in a flow run, else as functions in a pool.

    Parameters
    ----------
    threads : number of tasks of the pool at a time.
    """
    if is_recorded():
        # quoted: Prefect would look for futures in every value of a batch
        yield lambda task, *arguments, name=None: (task.with_options(name=name) if name else task).submit(
            *map(quote, arguments)
        )
        return
    with ThreadPoolExecutor(threads, thread_name_prefix="tasks") as pool:
        yield lambda task, *arguments, name=None: pool.submit(task.fn, *arguments)
