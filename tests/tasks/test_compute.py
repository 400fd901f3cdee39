"""The compute seam: the same calls here, on local processes and on a scheduler's address."""

from __future__ import annotations

import os
import socket
import sys
import threading
import time
from pathlib import Path

import cloudpickle
import pytest
from distributed import LocalCluster

from facade_core.errors import InputError
from tasks import cluster, compute
from tasks.cluster import ClusterGone, WorkersDied
from tasks.compute import connect

cloudpickle.register_pickle_by_value(sys.modules[__name__])


def square(x: int) -> tuple[int, int]:
    return x * x, os.getpid()


def fail(x: int) -> None:
    raise ValueError(f"unit {x}")


def die() -> None:
    os.kill(os.getpid(), 9)


def threads() -> tuple[list[int], int]:
    import cv2
    import sklearn.cluster  # noqa: F401 brings an OpenMP of its own
    from threadpoolctl import threadpool_info

    return [library["num_threads"] for library in threadpool_info()], cv2.getNumThreads()


@pytest.fixture(scope="module")
def workers():
    with LocalCluster(n_workers=1, threads_per_worker=2, host="127.0.0.1", dashboard_address=None) as local:
        yield local


@pytest.fixture(params=["serial", "scheduler"])
def where(request: pytest.FixtureRequest, tmp_path: Path):
    """Each of the two kinds of compute."""
    address = None if request.param == "serial" else request.getfixturevalue("workers").scheduler_address
    with connect(1, address, str(tmp_path)) as made:
        yield made


def test_units_complete_with_their_results(where: compute.Compute) -> None:
    units = [where.submit(square, i) for i in range(5)]
    results = [unit.result() for unit in where.completed(units)]
    assert sorted(square for square, _ in results) == [0, 1, 4, 9, 16]
    assert ({pid for _, pid in results} == {os.getpid()}) == isinstance(where, compute.Serial)


def test_a_failing_unit_fails_alone(where: compute.Compute) -> None:
    bad, good = where.submit(fail, 3), where.submit(square, 3)
    assert good.result()[0] == 9
    with pytest.raises(ValueError, match="unit 3"):
        bad.result()


def test_libraries_keep_to_one_thread_where_units_run(where: compute.Compute) -> None:
    """Asked in a thread as Prefect runs tasks in, on which a limit that the main thread sets does not hold for OpenMP."""
    seen = []
    thread = threading.Thread(target=lambda: seen.append(where.submit(threads).result()))
    thread.start()
    thread.join()
    libraries, vision = seen[0]
    assert set(libraries) == {1}
    assert vision == 1


def test_memory_of_workers_is_shared_out(where: compute.Compute) -> None:
    assert 1e8 < where.memory < 1e13
    assert where.threads == (1 if isinstance(where, compute.Serial) else 2)


def test_serial_units_of_two_tasks_take_turns_with_their_commits() -> None:
    """No unit starts between another's end and what its task does with it before it asks for the next."""
    events: list[str] = []

    def task(name: str) -> None:
        units = [serial.submit(events.append, f"{name} unit") for _ in range(10)]
        for unit in serial.completed(units):
            unit.result()
            time.sleep(0.002)
            events.append(f"{name} commit")

    serial = compute.Serial()
    both = [threading.Thread(target=task, args=(name,)) for name in "ab"]
    for thread in both:
        thread.start()
    for thread in both:
        thread.join()
    assert len(events) == 40
    assert all(commit == unit.replace("unit", "commit") for unit, commit in zip(events[::2], events[1::2], strict=True))


class FakeClient:
    """A scheduler that says what workers it has."""

    status = "running"

    def __init__(self, **workers: tuple[int, int]) -> None:
        self.workers = {name: {"nthreads": n, "memory_limit": memory} for name, (n, memory) in workers.items()}

    def scheduler_info(self, n_workers: int) -> dict:
        return {"workers": self.workers}


def holder(leases: cluster.Cluster, memory: int, held: list[str], let_go: threading.Event) -> threading.Thread:
    def hold() -> None:
        with leases.lease(memory) as name:
            held.append(leases._address(name)[0])
            let_go.wait(10)

    thread = threading.Thread(target=hold)
    thread.start()
    return thread


def settle(held: list[str], count: int) -> bool:
    deadline = time.monotonic() + 5
    while len(held) < count and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(0.05)
    return len(held) == count


def test_leases_spread_over_threads_and_wait_for_a_free_one() -> None:
    leases = cluster.Cluster(FakeClient(one=(1, 10**9), two=(2, 10**9)))  # type: ignore[arg-type]
    held: list[str] = []
    events = [threading.Event() for _ in range(4)]
    holders = [holder(leases, 10, held, event) for event in events[:3]]
    assert settle(held, 3)
    assert sorted(held) == ["one", "two", "two"]
    holders.append(holder(leases, 10, held, events[3]))
    assert settle(held, 3)  # no thread is free
    for event in events:
        event.set()
    for thread in holders:
        thread.join(5)
    assert settle(held, 4)
    assert not leases._leases


def test_a_lease_waits_for_memory_but_one_of_any_size_is_let_in() -> None:
    leases = cluster.Cluster(FakeClient(one=(8, 1000)))  # type: ignore[arg-type] units may declare 600
    held: list[str] = []
    big, small = threading.Event(), threading.Event()
    first = holder(leases, 5000, held, big)
    assert settle(held, 1)
    second = holder(leases, 400, held, small)
    assert settle(held, 1)
    big.set()
    first.join(5)
    assert settle(held, 2)
    third = holder(leases, 200, held, small)
    assert settle(held, 3)
    fourth = holder(leases, 1, held, small)
    assert settle(held, 3)
    small.set()
    for thread in (second, third, fourth):
        thread.join(5)
    assert len(held) == 4


def test_a_lease_moves_on_when_its_worker_is_lost_and_takes_one_that_joins(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "LOOK_S", 0.05)
    client = FakeClient(one=(1, 10**9))
    leases = cluster.Cluster(client)  # type: ignore[arg-type]
    with leases.lease(10) as name:
        assert leases._address(name) == ("one", 10)
        client.workers = FakeClient(two=(1, 10**9), three=(2, 10**9)).workers
        moved = leases._address(name)[0]
        assert moved in ("two", "three")
        assert leases._address(name)[0] == moved
        held: list[str] = []
        done = threading.Event()
        others = [holder(leases, 10, held, done) for _ in range(3)]
        assert settle(held, 2)
        client.workers |= FakeClient(late=(1, 10**9)).workers
        assert settle(held, 3)
        assert "late" in held
        done.set()
        for other in others:
            other.join(5)


def test_a_cluster_without_workers_is_not_waited_for_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "LOOK_S", 0.05)
    monkeypatch.setattr(cluster, "EMPTY_S", 0.2)
    client = FakeClient()
    empty = cluster.Cluster(client)  # type: ignore[arg-type]
    with pytest.raises(ClusterGone, match="no worker left; start some"), empty.lease(1):
        pass
    client.status = "connecting"
    with pytest.raises(ClusterGone, match="went away; run again"), empty.lease(1):
        pass


@pytest.fixture
def listener():
    """The address of a server that speaks something else."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer() -> None:
            while True:
                try:
                    with server.accept()[0] as client:
                        client.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")
                except OSError:
                    return

        threading.Thread(target=answer, daemon=True).start()
        yield f"tcp://127.0.0.1:{server.getsockname()[1]}"
        server.shutdown(socket.SHUT_RDWR)


MALFORMED = (
    "",
    "banana",
    "tcp://",
    "tcp://127.0.0.1",
    "tcp://127.0.0.1:x",
    "tcp://127.0.0.1:999999",
    "http://[::1]:8786",
)


@pytest.mark.parametrize("address", [*MALFORMED, "tcp://127.0.0.1:9", "127.0.0.1:9", "tcp://nowhere.invalid:8786"])
def test_an_address_without_a_scheduler_is_refused_at_once(address: str, tmp_path: Path) -> None:
    start = time.monotonic()
    with (
        pytest.raises(InputError, match="no scheduler answers there; start one with") as raised,
        connect(1, address, str(tmp_path)),
    ):
        pass
    assert address in str(raised.value)
    assert time.monotonic() - start < 10


def test_what_is_no_scheduler_is_refused(listener: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compute, "GREETING_S", 1)
    with pytest.raises(InputError, match="no scheduler answers there"), connect(1, listener, str(tmp_path)):
        pass


def test_a_scheduler_without_workers_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compute, "ANSWER_S", 1)
    with (
        LocalCluster(
            n_workers=0, host="127.0.0.1", dashboard_address="127.0.0.1:0", processes=False, protocol="tcp"
        ) as empty,
        pytest.raises(InputError, match="the scheduler has no worker"),
        connect(1, empty.scheduler_address, str(tmp_path)),
    ):
        pass


def test_workers_with_other_code_are_refused(
    workers: LocalCluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tasks.run.code_version", lambda: "other")
    with (
        pytest.raises(InputError, match="and this is other; start them in the same environment"),
        connect(1, workers.scheduler_address, str(tmp_path)),
    ):
        pass


def test_workers_that_cannot_write_where_units_do_are_refused(workers: LocalCluster, tmp_path: Path) -> None:
    from tasks.workers import standing

    assert standing(str(tmp_path / "elsewhere"))[0] is False
    (tmp_path / "token").touch()
    assert standing(str(tmp_path / "token"))[0] is True


def test_a_unit_that_kills_its_workers_fails_and_the_rest_goes_on(tmp_path: Path) -> None:
    """What waits on a worker that dies is suspected with what ran: it is tried again by itself."""
    with connect(2, None, str(tmp_path)) as made:
        units = {made.submit(die, memory=190_000_000): None}
        units |= {made.submit(square, i): i for i in range(12)}
        done = set()
        for unit in made.completed(list(units)):
            number = units.pop(unit)
            if number is None:
                with pytest.raises(
                    WorkersDied, match=r"workers that ran it died; it had declared 190 MB: give"
                ) as raised:
                    unit.result()
                assert "\n" not in str(raised.value)
            else:
                assert unit.result()[0] == number**2
                done.add(number)
        assert done == set(range(12))
        assert set(made.submit(threads).result()[0]) == {1}  # on a worker that was started anew
