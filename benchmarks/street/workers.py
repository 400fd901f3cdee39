"""The street stage with one worker and with two, on streets that share nothing, beside what the machine itself can do.

The block has no photos and no exemplars, so that the streets are all there is. Each run is the command `streetloom run`,
stopped before it publishes; its street stage lasts from the start of the first viewpoint to the end of the last street's
texels, by the journal. The machine's ceiling: the same viewpoints rendered, translated and propagated, without a store, by one
process and by two at a time.
"""

from __future__ import annotations

import json
import multiprocessing
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.process_usage import user_environment
from facade_core.atlas.journal import atlas_digest
from facade_core.atlas.store import BRANCH, open_repository, open_root
from facade_core.core.errors import StoreError
from tasks.engine.store.commits import read_newest_journal

STREETS, LENGTH_M, APART_M = 16, 60.0, 400.0
# Houses on either side: their fronts are this far from the centreline, this wide and this deep.
FRONT_M, HOUSE_M, DEPTH_M = 8.0, 12.0, 10.0
REPEATS = 1
# Seconds between two looks at whether a run's streets are done.
LOOK_S = 4.0


def measure(repeats: int = REPEATS) -> dict[str, Any]:
    """Wall seconds of the street stage by workers, in turn; medians, and their ratio beside the machine's."""
    with tempfile.TemporaryDirectory() as name:
        block = write_block(Path(name))
        stage: dict[int, list[float]] = {1: [], 2: []}
        alone: dict[int, list[float]] = {1: [], 2: []}
        digests = set()
        run_block(block, Path(name) / "warm", 2)
        for repeat in range(repeats):
            for workers in (1, 2):
                out = Path(name) / f"out-{workers}-{repeat}"
                digests.add(run_block(block, out, workers))
                stage[workers].append(street_seconds(out / "store"))
                alone[workers].append(_ceiling(block, workers))
    shares = {n: statistics.median(seconds) for n, seconds in stage.items()}
    ceiling = {n: statistics.median(seconds) for n, seconds in alone.items()}
    return {
        "streets": STREETS,
        "seconds": {f"{n} workers": [round(s, 1) for s in seconds] for n, seconds in stage.items()},
        "seconds_without_store": {f"{n} processes": [round(s, 1) for s in seconds] for n, seconds in alone.items()},
        "two_over_one": round(shares[1] / shares[2], 2),
        "machine_two_over_one": round(ceiling[1] / ceiling[2], 2),
        "same_digest": len(digests) == 1,
    }


def write_block(folder: Path, *, streets: int = STREETS, length: float = LENGTH_M) -> Path:
    """Streets far apart with houses on either side, into `folder`; returns the block file."""
    folder.mkdir(parents=True, exist_ok=True)
    lines: list[dict[str, Any]] = []
    houses: list[dict[str, Any]] = []
    for number in range(streets):
        y = number * APART_M
        lines.append(_feature({"id": f"s{number}"}, "LineString", [[0.0, y], [length, y]]))
        for side in (1, -1):
            near, far = y + side * FRONT_M, y + side * (FRONT_M + DEPTH_M)
            for house in range(int(length // HOUSE_M)):
                west, east = house * HOUSE_M, (house + 1) * HOUSE_M
                ring = [[west, near], [east, near], [east, far], [west, far], [west, near]]
                height = 9.0 + 3.0 * ((house + number) % 3)
                houses.append(_feature({"id": f"b{len(houses)}", "height": height}, "Polygon", [ring]))
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::3879"}}
    for name, features in (("streets", lines), ("buildings", houses)):
        content = {"type": "FeatureCollection", "crs": crs, "features": features}
        (folder / f"{name}.geojson").write_text(json.dumps(content))
    block = folder / "independent.yaml"
    block.write_text(
        "name: independent\ncrs: EPSG:3879\nbuildings: {path: buildings.geojson}\nstreets: {path: streets.geojson}\n"
        "texture: {walls: translate}\nseed: 1\n"
    )
    return block


def _feature(properties: dict[str, Any], kind: str, coordinates: Any) -> dict[str, Any]:
    def moved(value: Any) -> Any:
        """To where EPSG:3879 is used."""
        if isinstance(value[0], list):
            return [moved(one) for one in value]
        return [value[0] + 25_496_000.0, value[1] + 6_672_000.0]

    return {
        "type": "Feature",
        "properties": properties,
        "geometry": {"type": kind, "coordinates": moved(coordinates)},
    }


def run_block(block: Path, out: Path, workers: int) -> str:
    """Run the command until its streets are done; returns the atlas' digest."""
    command = [sys.executable, "-m", "flows", "run", str(block), "--out", str(out), "--workers", str(workers)]
    with subprocess.Popen(command, env=user_environment(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as run:
        while run.poll() is None and not _streets_done(out / "store"):
            time.sleep(LOOK_S)
        run.send_signal(signal.SIGINT)
    if not _streets_done(out / "store"):
        raise SystemExit(f"the run ended with {run.returncode} before its streets were done")
    session = open_repository(out / "store").readonly_session(BRANCH)
    return atlas_digest(open_root(session))


def _streets_done(store: Path) -> bool:
    try:
        held = read_newest_journal(store, "streets")
    except (StoreError, KeyError, FileNotFoundError):  # before the block is ingested
        return False
    return bool(held) and all(record and record["status"] == "done" for record in held)


def street_seconds(store: Path) -> float:
    """From the start of the first viewpoint to the end of the last street."""
    records = [r for stage in ("viewpoints", "streets") for r in read_newest_journal(store, stage) if r]
    ends = [r["started"] + sum(r["seconds"].values()) for r in records]
    return max(ends) - min(r["started"] for r in records)


def _ceiling(block: Path, processes: int) -> float:
    """Seconds in which so many processes walk all streets, from when all are ready to when the last has done."""
    context = multiprocessing.get_context("spawn")
    ready, results = context.Barrier(processes), context.SimpleQueue()
    shares = [list(range(first, STREETS, processes)) for first in range(processes)]
    walkers = [context.Process(target=_walk, args=(block, own, ready, results)) for own in shares]
    for walker in walkers:
        walker.start()
    spans = [results.get() for _ in walkers]
    for walker in walkers:
        walker.join()
    return max(end for _, end in spans) - min(start for start, _ in spans)


def _walk(block: Path, streets: Sequence[int], ready: Any, results: Any) -> None:
    """Render, translate and propagate every viewpoint of some streets."""
    from catalogs.block.reader import read_block
    from tasks.engine.compute.worker_setup import limit_threads
    from tasks.stages.ingest.planning import make_plan

    limit_threads()
    read = read_block(block)
    plan, width = make_plan(read), read.texture.panorama_width
    _walk_street(plan, streets[0], read.seed, width, steps=2)  # compiles, and builds what rays are cast with
    ready.wait()
    start = time.time()
    for street in streets:
        _walk_street(plan, street, read.seed, width)
    results.put((start, time.time()))


def _walk_street(plan: Any, street: int, seed: int, width: int, steps: int | None = None) -> None:
    import numpy as np

    from facade_core.street.propagation.propagate import propagate_panorama
    from facade_core.street.propagation.render import render_panorama
    from facade_core.street.propagation.texel_buffer import TexelBuffer
    from facade_core.street.translator.translators import MaterialFieldTranslator

    scene, own = plan.scene, plan.of_street(street)
    charts = np.unique(plan.views[np.isin(plan.views[:, 0], [v.id for v in own]), 1])
    rasters, write = TexelBuffer.plan_layout(scene.placement, charts, charts)
    nothing = np.zeros((rasters.total, 3), np.uint8), np.zeros(rasters.total, np.uint8)
    window, translator = (
        TexelBuffer.allocate(scene.placement, rasters, write, *nothing),
        MaterialFieldTranslator(scene, plan.streets, seed=seed),
    )
    for viewpoint in own[:steps]:
        panorama = render_panorama(scene, window, viewpoint, (width // 2, width))
        propagate_panorama(scene, window, viewpoint, translator.translate(panorama), charts_seen=panorama.chart)
