"""Overhead of units that do nothing, against plain `client.map`: `python -m benchmarks.unit_overhead [--units 1000]`.

Both run on the same local workers. The first, uncounted round connects the processes.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable
from typing import cast

from distributed import Client

from tasks.engine.compute.cluster import Cluster
from tasks.engine.compute.connect import Compute, connect


def do_nothing(number: int) -> int:
    """Return the number of the unit."""
    return number


def run_units(compute: Compute, count: int) -> int:
    """Run units as `tasks.engine.fan_out` does, and return the sum of their results."""
    units = [compute.submit(do_nothing, number) for number in range(count)]
    return sum(unit.result() for unit in compute.iterate_completed(units))


def map_plainly(client: Client, count: int) -> int:
    """Run the same calls by `client.map`, and return the sum of their results."""
    futures = client.map(do_nothing, range(count), pure=False)
    return sum(client.gather(futures))


def measure_ms(function: Callable[[int], int], count: int) -> float:
    """Measure the milliseconds per call."""
    start = time.perf_counter()
    assert function(count) == count * (count - 1) // 2
    return round(1000 * (time.perf_counter() - start) / count, 3)


def main() -> None:
    """Print the milliseconds per unit as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--units", type=int, nargs="+", default=[1_000, 20_000])
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, connect(options.workers, None, folder) as compute:
        client = cast(Cluster, compute)._client  # noqa: SLF001
        for count in (100, *options.units):
            units = measure_ms(lambda count: run_units(compute, count), count)
            plain = measure_ms(lambda count: map_plainly(client, count), count)
            if count != 100:
                print(json.dumps({"units": count, "unit_ms": units, "client_map_ms": plain}), flush=True)


if __name__ == "__main__":
    main()
