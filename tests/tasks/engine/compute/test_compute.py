"""The compute seam: the same calls here, on local processes and on a scheduler's address."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cloudpickle
import pytest
from distributed import Client, LocalCluster

from facade_core.core.errors import InputError
from tasks.engine.compute import connect as compute
from tasks.engine.compute.cluster import Cluster, ClusterGoneError, RunTimeoutError, Timeouts, WorkersDiedError
from tasks.engine.compute.connect import connect
from tests.pipeline.runs import ROOT, environment

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
    results = [unit.result() for unit in where.iterate_completed(units)]
    assert sorted(square for square, _ in results) == [0, 1, 4, 9, 16]
    assert ({pid for _, pid in results} == {os.getpid()}) == isinstance(where, compute.SerialCompute)


def test_a_failing_unit_fails_alone(where: compute.Compute) -> None:
    bad, good = where.submit(fail, 3), where.submit(square, 3)
    assert good.result()[0] == 9
    with pytest.raises(ValueError, match="unit 3"):
        bad.result()


def test_other_users_of_the_machine_do_not_reach_local_workers() -> None:
    with compute._start_local_client(1) as client:
        address = client.scheduler.address
        assert address.startswith("tls://127.0.0.1:")
        for foreign in (address.replace("tls", "tcp"), address):
            with pytest.raises((OSError, TimeoutError, TypeError)):
                Client(foreign, timeout=2, set_as_default=False).close()


def blocked_signals() -> set[signal.Signals | int]:
    return set(signal.pthread_sigmask(signal.SIG_BLOCK, ()))


def test_ctrl_c_reaches_this_process_only_and_no_worker_from_its_first_instruction(tmp_path: Path) -> None:
    """Also one started in place of one that died; a mask is inherited, so it holds while modules are imported."""
    with connect(2, None, str(tmp_path)) as made:
        with pytest.raises(WorkersDiedError):
            made.submit(die).result()
        assert signal.SIGINT in made.submit(blocked_signals).result()
        assert signal.SIGINT not in blocked_signals()


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
    assert where.threads == (1 if isinstance(where, compute.SerialCompute) else 2)


def test_serial_units_of_two_tasks_take_turns_with_their_commits() -> None:
    """No unit starts between another's end and what its task does with it before it asks for the next."""
    events: list[str] = []

    def task(name: str) -> None:
        units = [serial.submit(events.append, f"{name} unit") for _ in range(10)]
        for unit in serial.iterate_completed(units):
            unit.result()
            time.sleep(0.002)
            events.append(f"{name} commit")

    serial = compute.SerialCompute()
    both = [threading.Thread(target=task, args=(name,)) for name in "ab"]
    for thread in both:
        thread.start()
    for thread in both:
        thread.join()
    assert len(events) == 40
    assert all(commit == unit.replace("unit", "commit") for unit, commit in zip(events[::2], events[1::2], strict=True))


class FakeClient:
    """A client of a scheduler with some workers: name -> (threads, bytes)."""

    status = "running"
    scheduler = SimpleNamespace(identity=None)

    def __init__(self, **workers: tuple[int, int]) -> None:
        self.workers = workers
        self.silent = False

    def subscribe_topic(self, topic: str, handler: object) -> None:
        pass

    def sync(self, function: object, **keys: object) -> dict[str, Any]:
        if self.silent:
            raise TimeoutError
        named = self.workers.items()
        return {"workers": {name: {"nthreads": n, "memory_limit": limit} for name, (n, limit) in named}}

    def submit(self, *arguments: object, **keys: object) -> object:
        if self.status == "running":
            return SimpleNamespace(done=lambda: False, add_done_callback=lambda function: None)
        raise ValueError("the client is closed")


def make_cluster(client: Any, until: float | None = None, **timeouts: float) -> Cluster:
    return Cluster(client, until, Timeouts(poll_interval=0.05, **timeouts))


def test_a_cluster_without_workers_is_given_up() -> None:
    cluster = make_cluster(FakeClient(), empty=0.2)
    with pytest.raises(ClusterGoneError, match="no worker left; start some"):
        cluster.submit(square, 1).result()


def test_a_client_that_lost_its_scheduler_ends_the_run() -> None:
    client = FakeClient(one=(1, 10**9))
    cluster = make_cluster(client)
    client.status = "connecting"
    with pytest.raises(ClusterGoneError, match="went away; run again"):
        cluster.submit(square, 1)


def test_a_scheduler_that_does_not_answer_is_given_up() -> None:
    client = FakeClient(one=(1, 10**9))
    cluster = make_cluster(client, silence=0.2)
    client.silent = True
    with pytest.raises(ClusterGoneError, match="went away"):
        cluster.submit(square, 1).result()


def test_a_run_ends_at_its_deadline() -> None:
    cluster = make_cluster(FakeClient(one=(1, 10**9)), until=time.monotonic() + 0.2)
    with pytest.raises(RunTimeoutError, match="longer than its deadline; run again"):
        cluster.submit(square, 1).result()
    with pytest.raises(RunTimeoutError):
        compute.SerialCompute(until=time.monotonic()).submit(square, 1)


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
    with (
        pytest.raises(InputError, match="no scheduler answers there; start one with") as raised,
        connect(1, address, str(tmp_path), timeouts=Timeouts(connect=10_000)),  # or the test takes too long
    ):
        pass
    assert address in str(raised.value)


@pytest.fixture
def black_hole():
    """An address that takes no more connections and answers nothing."""
    with socket.create_server(("127.0.0.1", 0), backlog=0) as full:
        filling = [socket.socket() for _ in range(4)]
        for one in filling:
            one.setblocking(False)
            one.connect_ex(full.getsockname())
        yield f"tcp://127.0.0.1:{full.getsockname()[1]}"
        for one in filling:
            one.close()


@pytest.mark.parametrize("what", ["listener", "black_hole"])
def test_what_is_no_scheduler_is_refused(what: str, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    """Neither is waited for as long as a client of Dask's would."""
    address = request.getfixturevalue(what)
    with (
        pytest.raises(InputError, match="no scheduler answers there"),
        connect(1, address, str(tmp_path), timeouts=Timeouts(connect=1)),
    ):
        pass


def test_a_scheduler_without_workers_is_refused(tmp_path: Path) -> None:
    with (
        LocalCluster(
            n_workers=0, host="127.0.0.1", dashboard_address="127.0.0.1:0", processes=False, protocol="tcp"
        ) as empty,
        pytest.raises(InputError, match="the scheduler has no worker"),
        connect(1, empty.scheduler_address, str(tmp_path), timeouts=Timeouts(first_worker=1)),
    ):
        pass


def test_workers_with_other_code_are_refused(workers: LocalCluster, tmp_path: Path) -> None:
    with (
        pytest.raises(InputError, match="and this run other; start them in the same environment"),
        connect(1, workers.scheduler_address, str(tmp_path), versions=lambda: {"Streetloom": "other"}),
    ):
        pass


def test_what_a_run_asks_of_workers_leaves_the_scheduler_with_it(workers: LocalCluster, tmp_path: Path) -> None:
    """Else a worker of a newer make, which joins afterwards, would be closed for a run that is over."""

    def asked() -> list[str]:
        return [name for name in workers.scheduler.worker_plugins if "streetloom" in name]

    def looked_after() -> list[str]:
        return [name for name in workers.scheduler.plugins if "streetloom" in name]

    with connect(1, workers.scheduler_address, str(tmp_path)), connect(1, workers.scheduler_address, str(tmp_path)):
        assert len(asked()) == len(looked_after()) == 2  # each its own
    deadline = time.monotonic() + 120
    while (asked() or looked_after()) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not asked()
    assert not looked_after()


def test_workers_that_cannot_write_where_units_do_are_refused(workers: LocalCluster, tmp_path: Path) -> None:
    from tasks.engine.compute.worker_setup import inspect_worker

    assert inspect_worker(str(tmp_path / "elsewhere"))[0] is False
    (tmp_path / "token").touch()
    assert inspect_worker(str(tmp_path / "token"))[0] is True


@pytest.mark.long
def test_a_unit_that_kills_its_workers_fails_and_the_rest_goes_on(tmp_path: Path) -> None:
    """What waits on a worker that dies is suspected with what ran: it is tried again by itself."""
    with connect(2, None, str(tmp_path)) as made:
        units = {made.submit(die, memory=190_000_000): None}
        units |= {made.submit(square, i): i for i in range(12)}
        done = set()
        for unit in made.iterate_completed(list(units)):
            number = units.pop(unit)
            if number is None:
                with pytest.raises(
                    WorkersDiedError, match=r"workers that ran it died; it had declared 190 MB: give"
                ) as raised:
                    unit.result()
                assert "\n" not in str(raised.value)
            else:
                assert unit.result()[0] == number**2
                done.add(number)
        assert done == set(range(12))
        assert set(made.submit(threads).result()[0]) == {1}  # on a worker that was started anew


def run_python(code: str, folder: Path, **settings: str) -> subprocess.CompletedProcess[str]:
    """Run code in a process of its own; its output until the last of its processes has ended."""
    return subprocess.run(
        [sys.executable, "-c", code, str(folder)],
        cwd=ROOT,
        env=environment(folder) | settings,
        capture_output=True,
        text=True,
        timeout=300,
    )


@pytest.mark.long
def test_a_run_that_ends_at_once_leaves_nothing_on_stderr(tmp_path: Path) -> None:
    code = (
        "import os, sys; from tasks.engine.compute.connect import connect; at_work = connect(2, None, sys.argv[1]); "
        "at_work.__enter__(); print(os.environ.get('PYTHONWARNINGS'), flush=True); os._exit(130)"
    )
    done = run_python(code, tmp_path, PYTHONWARNINGS="default")
    assert (done.returncode, done.stdout) == (130, "default\n")
    assert "resource_tracker" not in done.stderr


def test_dask_says_nothing_of_its_own(tmp_path: Path) -> None:
    """Also where the process logs everything: what a unit raises comes back to its task, which says it."""
    code = (
        "import logging, sys; logging.basicConfig(level=logging.INFO); "
        "from tasks.engine.compute.connect import connect; connect(2, None, sys.argv[1]).__enter__()"
    )
    done = run_python(code, tmp_path)
    assert done.returncode == 0
    assert "distributed." not in done.stderr
