"""Textures each case by each method and prints what `benchmarks.mesh_texturing` says."""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path
from typing import Any

from benchmarks import mesh_texturing
from benchmarks.mesh_texturing.cases import Case, amsterdam_cases, perspective_cases, street_cases
from benchmarks.mesh_texturing.methods import measure_cases
from tasks.engine.compute.worker_setup import limit_threads


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mesh_texturing", description=mesh_texturing.__doc__)
    parser.add_argument("--data", type=Path, help="folder with city/amsterdam and facades/ecp, as the block names them")
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--buildings", type=int, default=8, help="houses on the street, an even number; 0 for none")
    parser.add_argument(
        "--cameras", type=int, default=5, help="panoramas of the street; 0 for perspective pictures alone"
    )
    parser.add_argument("--width", type=int, default=2048, help="pixels of a panorama of the street")
    parser.add_argument("--perspective", type=int, default=0, help="perspective pictures of the street; 0 for none")
    parser.add_argument("--perspective-width", type=int, default=1200, help="pixels of such a picture")
    parser.add_argument("--twice", action="store_true", help="texture a second time, and tell whether it is the same")
    parser.add_argument("--pictures", type=Path, help="folder for views: truth, ours, plain")
    options = parser.parse_args()
    limit_threads()
    cases: dict[str, list[Case]] = {}
    if options.buildings and options.cameras:
        size = {name: getattr(options, name) for name in ("seed", "buildings", "cameras", "width")}
        cases |= {f"street, {poses} poses": found for poses, found in street_cases(**size).items()}
    if options.perspective:
        size = {"seed": options.seed, "buildings": options.buildings or 8}
        found = perspective_cases(**size, pictures=options.perspective, width=options.perspective_width)
        cases |= {f"perspective pictures, {poses} poses": each for poses, each in found.items()}
    if options.data:
        cases["amsterdam"] = amsterdam_cases(options.data)
    load = os.getloadavg()[0]
    told: dict[str, Any] = {"benchmark": "mesh_texturing"}
    for name, each in cases.items():
        pictures = options.pictures and options.pictures / name.replace(", ", "-").replace(" ", "-")
        told[name] = measure_cases(each, pictures, twice=options.twice)
        print(f"{name}: {json.dumps(told[name])}", file=sys.stderr)
    print(json.dumps(told | {"load": [round(load, 1), round(os.getloadavg()[0], 1)]}, indent=1))


if __name__ == "__main__":
    main()
