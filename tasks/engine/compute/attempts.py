"""A unit of work on its way on a cluster, and the copies of it that were given to workers."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import CancelledError
from concurrent.futures import Future as Answer
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from distributed import Future

    from tasks.engine.compute.cluster import Cluster

# Seconds for a result to come from the worker that has it.
FETCH_S = 60.0


@dataclass(eq=False)
class UnitCopy:
    """A unit as given to Dask once.

    places: addresses of workers where it may run, None for all; at: where it was seen; ran: seconds that it was seen at work.
    """

    future: Future
    allowed_workers: frozenset[str] | None
    running_seconds: float = 0.0
    overdue: bool = False
    address: str | None = None


@dataclass(eq=False)
class UnitAttempt:
    """A unit on its way on a cluster, and the bytes it had declared.

    answer: the future of the copy that ended first; None once its workers died under it.
    """

    cluster: Cluster
    call: tuple[Callable[..., Any], *tuple[Any, ...]]
    memory: int
    lease: str | None
    copies: dict[str, UnitCopy] = field(default_factory=dict)
    deaths: int = 0
    alone: bool = False
    answer: Answer[Future | None] = field(default_factory=Answer)

    @property
    def stage(self) -> str:
        return getattr(self.call[0], "__name__", "unit")

    def result(self) -> Any:
        """What the unit returns, or raises.

        Raises WorkersDied when its workers died, and did so again with no other suspect beside it; UnitOverran; ClusterGone.
        """
        return self.cluster.result(self)


def fetch_result(future: Future) -> tuple[float, Any] | None:
    """What a future holds, or raises; None where the worker that has it does not give it."""
    from distributed.comm import CommClosedError

    for _ in range(3):
        try:
            return future.result(timeout=FETCH_S)
        except CancelledError:  # of this one, or of another that was asked for in the same message
            if future.status != "finished":
                return None
        except (TimeoutError, CommClosedError):
            if future.status == "error":
                raise
            return None
    return None
