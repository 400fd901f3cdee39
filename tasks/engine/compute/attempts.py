"""Units on a cluster, and the copies of each that were submitted."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import CancelledError
from concurrent.futures import Future as Answer
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

if TYPE_CHECKING:
    from distributed import Future

    from tasks.engine.compute.cluster import Cluster

R = TypeVar("R")
R_co = TypeVar("R_co", covariant=True)

# Seconds for a result to come from the worker that has it.
FETCH_S = 60.0


class SubmittedUnit(Protocol[R_co]):
    """Protocol of a unit that was submitted to any kind of compute."""

    def result(self) -> R_co:
        """Return the result of the unit, or raise its error."""
        ...


@dataclass(eq=False)
class UnitSubmission:
    """One submission of a unit to Dask.

    Attributes
    ----------
    allowed_workers : addresses of workers where it may run, None for all.
    address : worker where it was seen.
    running_seconds : seconds that it was seen running.
    """

    future: Future[tuple[float, object]]
    allowed_workers: frozenset[str] | None
    running_seconds: float = 0.0
    overdue: bool = False
    address: str | None = None


@dataclass(eq=False)
class ClusterUnit(Generic[R_co]):
    """A unit on a cluster, with all its submissions and the bytes that it declares.

    Attributes
    ----------
    answer : future of the copy that ended first; None once its workers died.
    """

    cluster: Cluster
    call: tuple[Callable[..., R_co], *tuple[object, ...]]
    memory: int
    lease: str | None
    copies: dict[str, UnitSubmission] = field(default_factory=dict)
    deaths: int = 0
    alone: bool = False
    answer: Answer[Future[tuple[float, R_co]] | None] = field(default_factory=Answer)

    @property
    def stage(self) -> str:
        """Return the name of the unit's function, by which durations are compared."""
        return getattr(self.call[0], "__name__", "unit")

    def result(self) -> R_co:
        """Return the result of the unit.

        Raises
        ------
        WorkersDied : its workers died, and did so again without another suspect.
        UnitOverran : it exceeded its deadline.
        ClusterGone : the cluster is gone.
        """
        return self.cluster.result(self)


def fetch_result(future: Future[tuple[float, R]]) -> tuple[float, R] | None:
    """Return the result of a future, or raise its error; None if its worker does not deliver it."""
    from distributed.comm.core import CommClosedError

    for _ in range(3):
        try:
            result: tuple[float, R] = future.result(timeout=FETCH_S)
            return result
        except CancelledError:  # of this one, or of another that was asked for in the same message
            if future.status != "finished":
                return None
        except (TimeoutError, CommClosedError):
            if future.status == "error":
                raise
            return None
    return None
