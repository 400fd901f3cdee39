"""Leases: the worker that keeps the state of each street, with one thread and the memory for that state."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from tasks.engine.compute.scheduler_view import WorkerState

# A function and its arguments.
ForgetCall = tuple[Callable[..., object], *tuple[object, ...]]


@dataclass
class WorkerLease:
    """A thread and `memory` bytes of the worker at `address`; `forget`, with its arguments, releases its state."""

    address: str
    memory: int
    forget: ForgetCall | None = None


class WorkerLeases:
    """The leases of a run. Not thread-safe: the owner locks."""

    def __init__(self) -> None:
        self._held: dict[str, WorkerLease] = {}

    def __getitem__(self, name: str) -> WorkerLease:
        return self._held[name]

    def take(self, name: str, lease: WorkerLease, workers: Mapping[str, WorkerState]) -> bool:
        """Place a lease on the least loaded of the workers that have room for it; False where none has.

        A worker has room if it has a thread without a lease, and memory for the lease next to the states that it keeps. A
        worker without states takes a state of any size.
        """
        free = [address for address, worker in workers.items() if self._fits(lease.memory, address, worker)]
        if free:
            lease.address = min(free, key=self._load)
            self._held[name] = lease
        return bool(free)

    def move(self, name: str, workers: Mapping[str, WorkerState]) -> bool:
        """Place a lease again whose worker is gone; False if it has to wait for room."""
        lease = self._held.pop(name)
        if self.take(name, lease, workers):
            return True
        self._held[name] = lease
        return False

    def end(self, name: str) -> WorkerLease:
        """Remove a lease and return it."""
        return self._held.pop(name)

    def _fits(self, memory: int, address: str, worker: WorkerState) -> bool:
        leases, held, _ = self._load(address)
        return leases < worker.threads and (not leases or held + memory <= worker.share)

    def _load(self, address: str) -> tuple[int, int, str]:
        held = [lease.memory for lease in self._held.values() if lease.address == address]
        return len(held), sum(held), address
