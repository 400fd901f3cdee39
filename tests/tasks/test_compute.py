"""The compute seam: the same calls here, on local processes and on a scheduler's address."""

from __future__ import annotations

import os

import pytest
from distributed import LocalCluster

from tasks.compute import connect


def square(x: int) -> tuple[int, int]:
    return x * x, os.getpid()


def fail(x: int) -> None:
    raise ValueError(f"unit {x}")


@pytest.fixture(scope="module")
def scheduler():
    with LocalCluster(n_workers=1, threads_per_worker=1, host="127.0.0.1", dashboard_address=None) as cluster:
        yield cluster.scheduler_address


def test_serial_runs_here() -> None:
    with connect(1, None) as compute:
        futures = [compute.submit(square, i) for i in range(5)]
        assert sorted(f.result()[0] for f in compute.completed(futures)) == [0, 1, 4, 9, 16]
        assert {f.result()[1] for f in futures} == {os.getpid()}


def test_an_address_runs_there(scheduler: str) -> None:
    with connect(1, scheduler) as compute:
        assert len(compute.workers) == 1
        futures = [compute.submit(square, i, worker=compute.workers[0]) for i in range(5)]
        assert sorted(f.result()[0] for f in compute.completed(futures)) == [0, 1, 4, 9, 16]
        assert os.getpid() not in {f.result()[1] for f in futures}


@pytest.mark.parametrize("where", ["serial", "scheduler"])
def test_a_failing_unit_fails_alone(where: str, scheduler: str) -> None:
    with connect(1, scheduler if where == "scheduler" else None) as compute:
        bad, good = compute.submit(fail, 3), compute.submit(square, 3)
        assert good.result()[0] == 9
        with pytest.raises(ValueError, match="unit 3"):
            bad.result()
