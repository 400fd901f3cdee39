"""Memory of the process of `streetloom city` by the number of blocks, which are simulated: each leaves what a block publishes.

    python -m benchmarks.city.coordinator [--blocks 4 18 1000] [--facades 280]

The city is a town of tiles, a tile a block, cut, planned and run by the command with its Prefect server. The first block is run
truly; the others publish its overview and tileset, and a catalogue of drawn facades. Megabytes are those of the command's own
process, read every second; `growth` is its peak over that of the fewest blocks.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import psutil

from benchmarks.city.many import APART_M, EAST, NORTH, write_published
from benchmarks.process_usage import user_environment
from benchmarks.timing import bytes_in, figures
from flows.server.startup import provide_prefect_server

# Blocks stand in so many rows.
ROWS = 25
SNAPSHOT = "SIMULATED"
LOOK_S = 1.0


def measure(blocks: int, facades: int) -> dict[str, Any]:
    """Run a city of so many blocks in a process of its own and look at its memory."""
    from benchmarks.city.reading import write_town

    with tempfile.TemporaryDirectory() as name:
        rows = min(ROWS, blocks)
        town = write_town(Path(name) / "town", -(-blocks // rows), rows)
        command = [
            sys.executable,
            "-m",
            "benchmarks.city.coordinator",
            "--simulate",
            str(town),
            "--facades",
            str(facades),
        ]
        begun = time.time()
        held: list[float] = []
        log = Path(name) / "log.txt"
        with log.open("w") as printed:
            process = subprocess.Popen(command, stdout=printed, stderr=printed, env=user_environment())
            while process.poll() is None:
                held.append(_resident_mb(process.pid))
                time.sleep(LOOK_S)
        if process.returncode:
            raise SystemExit(f"a city of {blocks} blocks ended with {process.returncode}:\n{log.read_text()[-2000:]}")
        out = Path(name) / "town" / "out"
        return {
            "blocks": json.loads((out / "summary.json").read_text())["blocks_done"],
            "seconds": figures(time.time() - begun),
            "peak_mb": figures(max(held)),
            "products_mb": figures(bytes_in(out / "items") / 1e6),
        }


def _resident_mb(pid: int) -> float:
    try:
        return psutil.Process(pid).memory_info().rss / 1e6
    except psutil.NoSuchProcess:
        return 0.0


def simulate(town: Path, facades: int) -> None:
    """Run the city of a town with simulated blocks in this process."""
    out = town.parent / "out"
    with provide_prefect_server(out / "prefect") as server:
        import flows.city  # Prefect, which it imports, loads its settings at its first import

        server.wait_until_ready()
        with mock.patch("flows.city.run_block", make_block_task(facades)):
            flows.city.city(town, out)


def make_block_task(facades: int) -> Any:
    """Return a task for `run_block`: the first call runs its block, the others publish what that did and drawn facades."""
    from prefect import task
    from prefect.cache_policies import NO_CACHE

    from tasks.city.block_process import run_block
    from tasks.city.city_log import BLOCKS_FOLDER, BlockResult, block_tileset_path

    numbers, turn = itertools.count(), threading.Lock()
    first: Future[tuple[str, BlockResult]] = Future()

    @task(name="block", task_run_name="block {name}", cache_policy=NO_CACHE)
    def simulate_block(
        out: Path,
        name: str,
        block_file: Path,
        options: Sequence[str],
        previous: BlockResult,
        digest: str,
        version: str,
        deadline: float | None,
        tiles: bool,
    ) -> BlockResult:
        with turn:
            number = next(numbers)
        if number == 0:
            try:
                result = run_block.fn(out, name, block_file, options, previous, digest, version, deadline, tiles)
            except BaseException as error:
                first.set_exception(error)
                raise
            first.set_result((name, result))
            return result
        real, result = first.result()
        blocks = out / BLOCKS_FOLDER
        corner = (EAST + APART_M * (number // ROWS), NORTH + APART_M * (number % ROWS))
        write_published(blocks / name, number, corner, facades, SNAPSHOT)
        published = blocks / name / "published" / SNAPSHOT
        shutil.copy(blocks / real / "published" / result.snapshot / "overview.glb", published)
        tileset = Path(str(block_tileset_path(blocks / name, SNAPSHOT)))
        tileset.parent.mkdir(parents=True)
        shutil.copy(str(block_tileset_path(blocks / real, result.snapshot)), tileset)
        return replace(result, digest=digest, version=version, snapshot=SNAPSHOT, tiles=SNAPSHOT)

    return simulate_block


def main() -> None:
    """Measure cities of several numbers of blocks and print the figures as JSON."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--blocks", type=int, nargs="+", default=[4, 18, 1000], help="how many [4 18 1000]")
    parser.add_argument("--facades", type=int, default=280, help="of each block [280]")
    parser.add_argument("--simulate", type=Path, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.simulate:
        simulate(asked.simulate, asked.facades)
        return
    cities = {str(blocks): measure(blocks, asked.facades) for blocks in asked.blocks}
    peaks = [city["peak_mb"] for city in cities.values()]
    print(json.dumps({"cores": os.cpu_count(), "cities": cities, "growth": figures(peaks[-1] / peaks[0])}, indent=1))


if __name__ == "__main__":
    main()
