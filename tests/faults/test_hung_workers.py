"""Workers killed together, stopped, stuck or of another make: what they had is done by others, and nobody waits for ever."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import cloudpickle
import dask
import pytest
from distributed import Client, LocalCluster

from facade_core.core.errors import MachineError
from tasks.engine.compute import connect as connections
from tasks.engine.compute.cluster import Cluster, ClusterGoneError, Timeouts, UnitTimeoutError
from tasks.engine.compute.connect import connect
from tasks.engine.compute.worker_setup import environment_versions, worker_setup_plugin
from tests.pipeline.runs import PATIENCE_S
from tests.pipeline.test_cluster import wait_until

cloudpickle.register_pickle_by_value(sys.modules[__name__])


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """Two local workers that are restarted after some seconds without a heartbeat."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(connections._DASK_SETTINGS, "distributed.scheduler.worker-ttl", "20s")
        with connect(2, None, str(tmp_path_factory.mktemp("two")), timeouts=Timeouts(poll_interval=0.2)) as made:
            yield made


@pytest.fixture(scope="module")
def hasty(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """Two others, on which a unit may take four seconds."""
    timeouts = Timeouts(poll_interval=0.2, unit=4.0)
    with connect(2, None, str(tmp_path_factory.mktemp("hasty")), timeouts=timeouts) as made:
        yield made


def worker() -> int:
    return os.getpid()


def slow(seconds: float, folder: str = "") -> int:
    """Takes so long, or the second time that it is begun in a folder no time."""
    if folder:
        begun = Path(folder) / "begun"
        if begun.exists():
            return os.getpid()
        begun.touch()
    time.sleep(seconds)
    return os.getpid()


def both(two: Cluster) -> set[int]:
    """The processes of both workers, once there are two."""
    deadline = time.monotonic() + PATIENCE_S
    found: set[int] = set()
    while len(found) < 2 and time.monotonic() < deadline:
        units = [two.submit(slow, 0.2) for _ in range(4)]
        found = {unit.result() for unit in two.iterate_completed(units)}
    assert len(found) == 2
    return found


@pytest.mark.long
def test_units_run_again_after_both_workers_were_killed(two: Cluster, tmp_path: Path) -> None:
    pids = both(two)
    unit = two.submit(slow, 600.0, str(tmp_path))
    wait_until((tmp_path / "begun").exists)
    for pid in pids:
        os.kill(pid, signal.SIGKILL)
    assert unit.result() not in pids


@pytest.mark.long
def test_a_stopped_worker_is_restarted_and_its_units_run_elsewhere(two: Cluster) -> None:
    pids = both(two)
    stopped = two.submit(worker).result()
    units = [two.submit(slow, 0.5), *(two.submit(slow, 0.1) for _ in range(10))]
    os.kill(stopped, signal.SIGSTOP)
    assert pids - {stopped} <= {unit.result() for unit in two.iterate_completed(units)}
    assert stopped not in both(two)


@pytest.mark.long
def test_a_unit_that_hangs_is_tried_elsewhere_and_its_worker_started_anew(hasty: Cluster, tmp_path: Path) -> None:
    pids = both(hasty)
    first = hasty.submit(slow, 600.0, str(tmp_path)).result()
    assert first in pids
    after = both(hasty)
    assert first in after
    assert after != pids


@pytest.mark.long
def test_a_unit_that_hangs_everywhere_fails_alone(hasty: Cluster) -> None:
    both(hasty)
    hangs, good = hasty.submit(slow, 600.0), hasty.submit(worker)
    with pytest.raises(UnitTimeoutError, match="did not end within 4 s on any worker") as raised:
        hangs.result()
    assert not isinstance(raised.value, MachineError)  # the rest is done without it
    assert good.result()
    assert both(hasty)


DIES = """
import os
if len(os.listdir({folder!r})) < {times}:
    open(os.path.join({folder!r}, str(os.getpid())), "w").close()
    os._exit(3)
"""


@pytest.mark.parametrize("times", [1, 99])
def test_a_worker_that_dies_while_it_starts(tmp_path: Path, times: int, capfd: pytest.CaptureFixture[str]) -> None:
    """Once: the workers are started again. Again and again: one line."""
    dead, first = tmp_path / "dead", tmp_path / "first.py"
    dead.mkdir()
    first.write_text(DIES.format(folder=str(dead), times=times))
    with dask.config.set({"distributed.worker.preload": [str(first)]}):
        if times == 1:
            with connect(2, None, str(tmp_path)) as made:
                assert made.submit(worker).result()
        else:
            with (
                pytest.raises(ClusterGoneError, match=r"^2 local workers do not start; .*--workers$"),
                connect(2, None, str(tmp_path)),
            ):
                pass
    assert any(dead.iterdir())
    said = capfd.readouterr()
    assert "Traceback" not in said.out + said.err


def test_a_late_worker_of_another_make_is_not_used() -> None:
    local = {
        "host": "127.0.0.1",
        "dashboard_address": "127.0.0.1:0",
        "processes": False,
        "protocol": "tcp",
        "threads_per_worker": 1,
    }
    with LocalCluster(n_workers=1, **local) as there, Client(there) as client:
        (first,) = client.scheduler_info(n_workers=-1)["workers"]
        asked = environment_versions() | {"numpy": "0.9"}
        client.register_plugin(worker_setup_plugin(asked), name="streetloom")
        # Asked of the scheduler, which keeps what workers say: a subscription made just before may come after the line.
        wait_until(lambda: client.get_events("streetloom"))
        wait_until(lambda: not client.scheduler_info(n_workers=-1)["workers"])
        ((_, (line, _)),) = client.get_events("streetloom")
    assert f"at {first} has numpy" in line
    assert "and this run 0.9; it is not used" in line
