"""Leases of workers' threads and memory, and how long a unit may take."""

from __future__ import annotations

import pytest

from tasks.engine.compute.deadlines import MAX_MEDIAN_FACTOR, Deadlines
from tasks.engine.compute.leases import WorkerLease, WorkerLeases
from tasks.engine.compute.scheduler_view import SchedulerView, WorkerRegistry, WorkerState
from tasks.engine.compute.timeouts import DEFAULT_TIMEOUTS


def workers(**named: tuple[int, int]) -> dict[str, WorkerState]:
    return {name: WorkerState(name, threads, memory) for name, (threads, memory) in named.items()}


def test_leases_spread_over_threads_and_none_is_given_twice() -> None:
    leases, there = WorkerLeases(), workers(one=(1, 10**9), two=(2, 10**9))
    held = [WorkerLease("", 10) for _ in range(4)]
    assert [leases.take(str(i), lease, there) for i, lease in enumerate(held)] == [True, True, True, False]
    assert sorted(lease.address for lease in held) == ["", "one", "two", "two"]
    leases.end("0")
    assert leases.take("3", held[3], there)


def test_a_lease_waits_for_memory_but_one_of_any_size_is_let_in() -> None:
    leases, there = WorkerLeases(), workers(one=(8, 1000))  # of which units may declare 600
    assert leases.take("big", WorkerLease("", 5000), there)
    assert not leases.take("small", WorkerLease("", 400), there)
    leases.end("big")
    assert leases.take("small", WorkerLease("", 400), there)
    assert leases.take("other", WorkerLease("", 200), there)
    assert not leases.take("last", WorkerLease("", 1), there)


def test_a_lost_workers_lease_waits_for_room() -> None:
    leases, both = WorkerLeases(), workers(one=(1, 10**9), two=(1, 10**9))
    first, second = WorkerLease("", 10), WorkerLease("", 10)
    assert leases.take("first", first, both)
    assert leases.take("second", second, both)
    left = {name: worker for name, worker in both.items() if name != first.address}
    assert not leases.move("first", left)  # the other's only thread is taken
    assert leases.move("first", left | workers(three=(1, 10**9)))
    assert first.address == "three"
    leases.end("first")
    leases.end("second")


def test_a_worker_that_gives_no_sign_is_left_out_until_it_does(caplog: pytest.LogCaptureFixture) -> None:
    def view(one: float, running: bool = True) -> SchedulerView:
        return SchedulerView(
            {"one": WorkerState("one", 1, running=running, last_seen=one), "two": WorkerState("two", 1, last_seen=one)}
        )

    half = DEFAULT_TIMEOUTS.worker_silence / 2
    roll = WorkerRegistry(view(0), DEFAULT_TIMEOUTS)
    for _ in range(7):  # it has just joined
        roll.update(view(0), half)
        assert roll.usable.keys() == {"one", "two"}
    for last_seen, running, names in [
        (1, True, {"one", "two"}),
        (2, False, {"one", "two"}),
        (3, False, {"two"}),  # it gives signs, and takes no units
        (4, True, {"one", "two"}),
        (4, True, {"one", "two"}),
        (4, True, set()),  # a scheduler that hears of nobody
        (5, True, {"one", "two"}),
    ]:
        roll.update(view(last_seen, running), half)
        assert roll.usable.keys() == names
    assert caplog.messages.count("worker one at one gives no sign; its units are done elsewhere") == 2
    roll.stuck.add("one")
    assert roll.usable.keys() == {"two"}
    roll.stuck.add("two")
    roll.update(view(6), 10)
    assert roll.empty == 10


def test_a_unit_may_take_many_times_the_median_of_its_stage() -> None:
    known = Deadlines(DEFAULT_TIMEOUTS)
    assert known.limit("facade_unit") == DEFAULT_TIMEOUTS.unit_first
    for seconds in (1.0, 2.0, 90.0):
        known.record("facade_unit", seconds)
    assert known.limit("facade_unit") == DEFAULT_TIMEOUTS.unit_least
    assert known.limit("viewpoints_unit") == DEFAULT_TIMEOUTS.unit_first
    for seconds in (80.0, 100.0, 120.0, 90.0, 110.0):
        known.record("facade_unit", seconds)
    assert known.limit("facade_unit") == MAX_MEDIAN_FACTOR * 90
