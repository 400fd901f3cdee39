"""0009: why heavy imports stand inside functions."""

from __future__ import annotations

import statistics
import subprocess
import sys
from pathlib import Path
from typing import Any

from benchmarks.timing import figures, once

HEAVY = ("prefect", "distributed", "geopandas", "rasterio", "trimesh", "cv2", "numba", "xarray", "icechunk", "zarr")
OPEN3D = "from facade_core.geometry.raycast import ray_library; ray_library()"


def measure(quick: bool, data: Path | None) -> dict[str, Any]:
    """Seconds to import each heavy package in a fresh process, and to answer `streetloom --help`."""
    repeats = 1 if quick else 3
    packages = HEAVY[-2:] if quick else HEAVY
    bare = _seconds(["-c", "pass"], repeats)
    imports = {name: _seconds(["-c", f"import {name}"], repeats) - bare for name in packages}
    if not quick:
        imports["open3d"] = _seconds(["-c", OPEN3D], repeats) - bare
    together = _seconds(["-c", f"import {', '.join(packages)}"], repeats) - bare  # they share what they import
    answer = _seconds(["-m", "flows", "--help"], repeats)
    return {
        "interpreter_seconds": figures(bare),
        "import_seconds": {name: figures(s) for name, s in sorted(imports.items(), key=lambda item: -item[1])},
        "all_but_open3d_in_one_process_seconds": figures(together),
        "help_seconds": figures(answer),
    }


def _seconds(arguments: list[str], repeats: int) -> float:
    command = [sys.executable, *arguments]

    def run() -> None:
        subprocess.run(command, check=True, capture_output=True)

    run()  # the files are in the page cache from here on
    return statistics.median(once(run) for _ in range(repeats))
