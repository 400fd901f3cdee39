"""Fetching street pictures: `python -m benchmarks.fetching` prints one JSON object.

resume: pictures of a server on loopback (1,000 of 256 x 128 pixels, 20 ms each), fetched by a process that is killed (SIGKILL)
when half of them are there, and by a second one to the end: seconds, requests, and pictures asked for again though they had
arrived. choose: panoramas every few metres on the streets of a block (the demo's): how many show all that any of them shows,
and how much as many show that are spread evenly, or taken at random.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.imagery_server import Imagery, Shot, picture_path, serving
from catalogs.block.settings import replace_settings

BOX = ("7", "48", "8", "49")


def resume(count: int) -> dict[str, Any]:
    """Fetch `count` pictures, killed half way."""
    shots = [Shot(f"p{i}", 7.0 + i / count, 48.5) for i in range(count)]
    with tempfile.TemporaryDirectory() as temporary, serving(Imagery(shots, delay_s=0.02)) as served:
        folder = Path(temporary) / "pictures"
        command = [sys.executable, "-m", "flows", "fetch-imagery", "--bbox", *BOX, "--to", str(folder)]
        command += ["--from", served.stac()]
        start = time.monotonic()
        first = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        while _there(folder) < count // 2 and first.poll() is None:
            time.sleep(0.01)
        os.kill(first.pid, signal.SIGKILL)
        first.wait()
        killed, arrived = time.monotonic() - start, {path.stem for path in folder.glob("*.jpg")}
        start = time.monotonic()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        ended = time.monotonic() - start
        asked = [served.asked[picture_path(shot.id)] for shot in shots]
        return {
            "pictures": count,
            "there_when_killed": len(arrived),
            "seconds_until_killed": round(killed, 1),
            "seconds_of_the_second_run": round(ended, 1),
            "there_at_last": _there(folder),
            "in_poses_file": len(json.loads((folder / "poses.json").read_text(encoding="utf-8"))["poses"]),
            "requests_for_pictures": sum(asked),
            "arrived_and_asked_for_again": sum(served.asked[picture_path(name)] > 1 for name in arrived),
            "cut_off_by_the_kill": sum(times > 1 for times in asked),
        }


def _there(folder: Path) -> int:
    return len(list(folder.glob("*.jpg")))


def choose(block_file: Path, spacing: float) -> dict[str, Any]:
    """Choose among panoramas every `spacing` metres on the streets of a block."""
    from catalogs.block.reader import read_block
    from facade_core.core.types import Pose
    from facade_core.plan.panorama_choice import choose_panoramas, coverage_area
    from tasks.stages.ingest.planning import make_plan

    block = read_block(block_file)
    settings = replace_settings(block.settings, panorama_width=256, viewpoint_spacing=spacing)
    plan = make_plan(replace(block, panoramas=(), settings=settings))
    poses = [Pose(x, y, z, 0.0) for x, y, z in (camera.position.tolist() for camera in plan.viewpoints)]
    sizes = [(4096, 8192)] * len(poses)
    start = time.monotonic()
    found = choose_panoramas(plan.scene, plan.facades, poses, sizes)
    seconds = time.monotonic() - start
    count, rng = len(found.chosen), np.random.default_rng(0)
    even = np.unique(np.linspace(0, len(poses) - 1, count).round().astype(int)).tolist()
    drawn = [rng.choice(len(poses), count, replace=False).tolist() for _ in range(5)]
    shares = [coverage_area(plan.scene, plan.facades, poses, sizes, some) / found.shown for some in (even, *drawn)]
    return {
        "offered": len(poses),
        "chosen": count,
        "facades": found.facades,
        "facades_shown": found.facades_shown,
        "share_shown_by_the_chosen": round(found.reached / found.shown, 3),
        "by_as_many_evenly": round(shares[0], 3),
        "by_as_many_at_random": round(float(np.mean(shares[1:])), 3),
        "seconds": round(seconds, 1),
    }


def _demo(folder: Path) -> Path:
    """The demo's block without its painted pictures, on which nothing here stands."""
    from PIL import Image

    from tasks.examples.demo import write_demo

    (folder / "exemplars").mkdir()
    Image.new("RGB", (64, 64)).save(folder / "exemplars" / "none.png")
    return write_demo(folder / "demo", folder / "exemplars")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("block", type=Path, nargs="?", help="a block file [the demo's streets]")
    parser.add_argument("--pictures", type=int, default=1000, help="of `resume`; 0 leaves it out")
    parser.add_argument("--spacing", type=float, default=4.0, help="metres between panoramas")
    asked = parser.parse_args()
    found = {"resume": resume(asked.pictures)} if asked.pictures else {}
    with tempfile.TemporaryDirectory() as folder:
        found["choose"] = choose(asked.block or _demo(Path(folder)), asked.spacing)
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
