"""The viewer's page on a large block: `python -m benchmarks.viewer` prints one JSON object.

Central Helsinki with all its streets, ingested as a run does it, with a record for every facade as a finished one has; none
is textured. opens_s: from the first request to the last facade on the map, in Chromium, median and largest of some visits with
an empty cache; weight_kb: what travels for that page; facade_s and street_s: until those pages are there; answers_ms:
of the server alone.
"""

from __future__ import annotations

import argparse
import json
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import yaml

from benchmarks.programs import CHROMIUM, chromium

if TYPE_CHECKING:
    from facade_core.atlas.journal import Record

AREA = [24.9375, 60.1615, 24.9565, 60.1715]


def write_store(folder: Path, area: list[float]) -> int:
    """A run's folder `folder`/out without textures; returns how many facades it has."""
    import pyrosm

    from catalogs.block.reader import read_block
    from facade_core.atlas.journal import write_record
    from facade_core.atlas.store import BRANCH, commit, open_repository, open_root
    from tasks.engine.context import load_run_plan
    from tasks.engine.run_key import create_run
    from tasks.stages.ingest.task import ingest_block

    shutil.copyfile(pyrosm.get_data("helsinki_pbf"), folder / "helsinki.osm.pbf")
    (folder / "exemplars").mkdir()
    _blank(folder / "exemplars" / "blank.png")
    block_file = folder / "helsinki.yaml"
    block = {
        "name": "helsinki",
        "area": area,
        "buildings": {"path": "helsinki.osm.pbf"},
        "streets": {"path": "helsinki.osm.pbf"},
        "imagery": {"exemplars": {"path": "exemplars"}},
        "texture": {"texels_per_metre": 4, "viewpoint_spacing": 20.0},
    }
    block_file.write_text(yaml.safe_dump(block), encoding="utf-8")
    read = read_block(block_file)
    run = create_run(read, folder / "out")
    (folder / "out").mkdir()
    run = replace(run, ingested=ingest_block.fn(run, read).ingested)
    facades = load_run_plan(run).facades.id
    session = open_repository(run.store).writable_session(BRANCH)
    group = open_root(session)
    for number, name in enumerate(facades):
        write_record(group, "facades", number, _record(name, number))
    commit(session, "records")
    return len(facades)


def _record(name: str, number: int) -> Record:
    counts = {
        "windows": number % 40,
        "doors": number % 2,
        "balconies": number % 9,
        "shops": number % 4,
        "columns": number % 8,
    }
    variation = {"variation_types": number % 12, "variation_levels": 6, "variation_bytes": 4000 + number}
    shares = {"window_to_wall": number % 50 / 100, "occluded": number % 30 / 100, "layout_score": -number / 100}
    record: Any = {
        "unit": name, "key": "", "status": "done", "source": f"exemplar-{number % 14:02d}.png", "masked": [],
        "provenance": [0.0, 0.0, 0.6, 0.1, 0.3], "lattice": {"rows": [0, 1], "columns": [0, 1]}, "seconds": {"parse": 0.7},
        "elements": [], **counts, **variation, **shares,
    }  # fmt: skip
    return cast("Record", record)


def _blank(path: Path) -> None:
    from PIL import Image

    Image.new("RGB", (200, 300), (180, 170, 160)).save(path)


def visit(address: str, visits: int) -> dict[str, Any]:
    """Open the pages in Chromium."""
    from playwright.sync_api import sync_playwright

    if CHROMIUM is None:
        raise SystemExit("benchmarks.viewer: no Chromium on this machine; `make clients` brings one")
    block = json.loads(urllib.request.urlopen(f"{address}/api/block").read())
    facade = block["facades"][len(block["facades"]) // 2]["id"]
    pages = {"opens": ("", "tbody tr"), "facade": (f"#/facade/{facade}", "dl.facts"), "street": ("#/street", "#step")}
    seconds: dict[str, list[float]] = {name: [] for name in pages}
    weight = 0
    with sync_playwright() as playwright, chromium(playwright) as browser:
        for _ in range(visits):
            for name, (place, there) in pages.items():
                page = browser.new_page(viewport={"width": 1280, "height": 860})
                sizes: list[int] = []
                session = page.context.new_cdp_session(page)
                session.send("Network.enable")
                session.on(
                    "Network.loadingFinished", lambda done, sizes=sizes: sizes.append(int(done["encodedDataLength"]))
                )
                begun = time.perf_counter()
                page.goto(f"{address}/{place}")
                page.wait_for_selector(there)
                seconds[name].append(time.perf_counter() - begun)
                if name == "opens":
                    weight = sum(sizes)
                page.close()
    return {
        **{f"{name}_s": [round(f(of), 2) for f in (statistics.median, max)] for name, of in seconds.items()},
        "weight_kb": round(weight / 1000),
    }


def answers(address: str) -> dict[str, float]:
    """Milliseconds of the server, median of ten."""

    def timed(path: str) -> float:
        taken = []
        for _ in range(10):
            begun = time.perf_counter()
            urllib.request.urlopen(address + path).read()
            taken.append(1000 * (time.perf_counter() - begun))
        return round(statistics.median(taken), 1)

    return {path: timed(path) for path in ("/api/block", "/api/progress")}


def main() -> None:
    """Print the report."""
    parser = argparse.ArgumentParser(prog="benchmarks.viewer", description=__doc__)
    parser.add_argument("--visits", type=int, default=5)
    parser.add_argument("--area", type=float, nargs=4, default=AREA, metavar=("W", "S", "E", "N"))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        count = write_store(Path(scratch), options.area)
        report: dict[str, Any] = {"benchmark": "viewer", "facades": count}
        _serving(
            Path(scratch) / "out",
            lambda address: report.update(visit(address, options.visits), answers_ms=answers(address)),
        )
    print(json.dumps(report))


def _serving(out: Path, use: Callable[[str], None]) -> None:
    command = [sys.executable, "-m", "flows", "view", str(out), "--port", "0", "--no-open"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        use(process.stdout.readline().split()[0])
    finally:
        process.terminate()
        process.wait(20)


if __name__ == "__main__":
    main()
