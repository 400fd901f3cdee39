"""0001: what handing out a unit costs that does nothing, one by one and fanned out."""

from __future__ import annotations

import logging
import statistics
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks.timing import figures, once, seconds
from flows.server.starting import server

WORKERS = 2


def measure(quick: bool, data: Path | None) -> dict[str, Any]:
    """Milliseconds per unit of work that does nothing, through each way to hand it out; 2 workers, Prefect's server local."""
    units, repeats = (8, 1) if quick else (200, 5)
    with tempfile.TemporaryDirectory() as folder, server(Path(folder) / "prefect") as prefect:
        prefect.require()
        import dask
        from distributed import Client, LocalCluster

        logging.getLogger("distributed").setLevel(logging.ERROR)
        with (
            dask.config.set({"distributed.worker.daemon": False}),
            LocalCluster(
                n_workers=WORKERS, threads_per_worker=1, host="127.0.0.1", dashboard_address=None, silence_logs=50
            ) as cluster,
            Client(cluster) as client,
        ):
            ways = {
                "client_map": seconds(lambda: _mapped(client, units), repeats),
                "client_submit": seconds(lambda: _submitted(client, units), repeats),
            }
            alone = {"client_submit": seconds(lambda: client.submit(_nothing, 0, pure=False).result(), units)}
            fan_out, one_by_one = _prefect("ThreadPoolTaskRunner", None, units, repeats)
            ways["prefect_threads"], alone["prefect_threads"] = fan_out, one_by_one
            # a task that crosses to a worker takes so long that fewer of them say as much
            fan_out, one_by_one = _prefect("DaskTaskRunner", cluster.scheduler_address, max(8, units // 5), repeats)
            ways["prefect_dask_runner"], alone["prefect_dask_runner"] = (
                fan_out * (units / max(8, units // 5)),
                one_by_one,
            )
    per_unit = {name: wall / units for name, wall in ways.items()}
    return {
        "units": units,
        "ms_per_unit_fanned_out": {name: figures(1000 * s) for name, s in per_unit.items()},
        "ms_per_unit_one_by_one": {name: figures(1000 * s) for name, s in alone.items()},
        "dask_runner_over_client_map": figures(per_unit["prefect_dask_runner"] / per_unit["client_map"]),
        "dask_runner_over_prefect_threads": figures(per_unit["prefect_dask_runner"] / per_unit["prefect_threads"]),
    }


def _nothing(unit: int) -> int:
    return unit


def _mapped(client: Any, units: int) -> None:
    client.gather(client.map(_nothing, range(units), pure=False))


def _submitted(client: Any, units: int) -> None:
    client.gather([client.submit(_nothing, unit, pure=False) for unit in range(units)])


def _prefect(runner: str, address: str | None, units: int, repeats: int) -> tuple[float, float]:
    """Seconds for `units` tasks submitted at once, and for one submitted and awaited, in a flow that has run tasks before."""
    from prefect import flow, task
    from prefect.task_runners import ThreadPoolTaskRunner
    from prefect_dask import DaskTaskRunner

    task_runner: Any = ThreadPoolTaskRunner(max_workers=8) if address is None else DaskTaskRunner(address=address)
    nothing = task(name="nothing")(_nothing)

    def fanned_out() -> None:
        for future in [nothing.submit(unit) for unit in range(units)]:
            future.result()

    def one() -> None:
        nothing.submit(0).result()

    @flow(name=f"no-op through {runner}", task_runner=task_runner)
    def timed() -> tuple[float, float]:
        for _ in range(2 * WORKERS):  # a worker's first task imports Prefect there
            one()
        return _median(fanned_out, repeats), _median(one, max(3, units // 10))

    return timed()


def _median(action: Callable[[], None], repeats: int) -> float:
    return statistics.median(once(action) for _ in range(repeats))
