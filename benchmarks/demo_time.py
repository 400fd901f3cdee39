"""Seconds of the whole demo beside those of another revision, with their ratios.

Both sides run `streetloom demo` as a user does, one after the other: with an empty cache of kernels, then with a full one,
then `streetloom run` after one photo changed. Wall time, processor seconds of all processes, memory of all at its peak,
and seconds until the first picture.

    python -m benchmarks.demo_time --before HEAD~10
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import psutil
from PIL import Image

from benchmarks.process_usage import add_used, measure_family_mb, user_environment
from benchmarks.same_bytes import ROOT, check_out
from benchmarks.timing import figures

PREVIEW = "preview.jpg"
# Seconds between two looks at the processes.
INTERVAL = 0.5


def measure(before: str | None) -> dict[str, Any]:
    """Measure the first and the compiled run of this checkout, and of another revision."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        sides = {"after": ROOT}
        if before is not None:
            check_out(before, folder / "checkout")
            sides["before"] = folder / "checkout"
        found: dict[str, Any] = {"load": [round(load, 1) for load in os.getloadavg()]}
        for run in ("first", "compiled", "photo"):
            found[run] = {
                side: _time_run(checkout, folder / f"kernels-{side}", folder / side, change_photo=run == "photo")
                for side, checkout in sides.items()
            }
            if before is not None:
                after, other = found[run]["after"], found[run]["before"]
                found[run]["ratio"] = {
                    key: figures(after[key] / other[key]) for key in ("seconds", "processor", "peak_mb")
                }
    return found


def _darken_photo(block: Path) -> None:
    """Make the first photo of a block a little darker."""
    photo = min((block.parent / "photos").iterdir())
    with Image.open(photo) as image:
        image.convert("RGB").point(lambda level: round(0.9 * level)).save(photo)


def _time_run(checkout: Path, kernels: Path, out: Path, *, change_photo: bool) -> dict[str, float | None]:
    """Run the demo anew into a folder, or again after one of its photos has changed."""
    settings = user_environment() | {"PYTHONPATH": str(checkout), "NUMBA_CACHE_DIR": str(kernels)}
    command = ["demo"]
    if change_photo:
        block = out / "input" / "helsinki.yaml"
        command = ["run", str(block)]
        _darken_photo(block)
        (out / PREVIEW).unlink(missing_ok=True)
    else:
        shutil.rmtree(out, ignore_errors=True)
    begun, picture, peak = time.time(), None, 0.0
    used: dict[int, tuple[str, float]] = {}
    with subprocess.Popen(
        [sys.executable, "-m", "flows", *command, "--out", str(out)],
        cwd=checkout,
        env=settings,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as process:
        root = psutil.Process(process.pid)
        while process.poll() is None:
            add_used(root, used)
            peak = max(peak, measure_family_mb(process.pid))
            if picture is None and (out / PREVIEW).is_file():
                picture = time.time() - begun
            time.sleep(INTERVAL)
    if process.returncode:
        raise SystemExit(f"{checkout}: `{command[0]}` ended with {process.returncode}")
    return {
        "seconds": round(time.time() - begun, 1),
        "processor": round(sum(seconds for _, seconds in used.values()), 1),
        "peak_mb": round(peak),
        "first_picture": None if picture is None else round(picture, 1),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--before", help="a revision to measure beside this checkout")
    print(json.dumps(measure(parser.parse_args().before), indent=2))


if __name__ == "__main__":
    main()
