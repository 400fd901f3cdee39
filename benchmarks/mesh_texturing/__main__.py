"""Textures each case by each method and prints what `benchmarks.mesh_texturing` says."""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import psutil

from benchmarks import mesh_texturing
from benchmarks.imagery import pose_errors
from benchmarks.mesh_texturing.cases import Case, amsterdam_cases, perspective_cases, street_cases
from benchmarks.mesh_texturing.comparison import (
    ComparedView,
    Sampler,
    chart_sampler,
    compare_views,
    face_sampler,
    measure_likeness,
)
from benchmarks.mesh_texturing.ours import texture_as_a_run, texture_by_best_view
from benchmarks.mesh_texturing.registered_rasters import texture_by_meshlab
from tasks.engine.compute.worker_setup import limit_threads

# Seconds between two looks at the memory.
LOOK_S = 0.05


def measure(cases: Sequence[Case], environments: Path, pictures: Path | None, *, twice: bool) -> dict[str, Any]:
    """Texture the cases by each method, and compare.

    `pictures` is a folder for their views; `twice` textures a second time and tells whether that makes the same bytes.
    """
    views: list[ComparedView] = []
    costs: dict[str, list[dict[str, float]]] = {}
    same: dict[str, bool] = {}
    skipped: dict[str, str] = {}
    faces: list[float] = []
    for number, case in enumerate(cases):
        samplers: dict[str, Sampler] = {}
        with tempfile.TemporaryDirectory(prefix="mesh-texturing-") as folder:
            place = Path(folder)
            files = _write_panoramas(case, place)
            makers = {"ours": partial(texture_as_a_run, case, files), "plain": partial(texture_by_best_view, case)}
            for name, make in makers.items():
                rasters, cost = measure_cost(make)
                costs.setdefault(name, []).append(cost)
                samplers[name] = chart_sampler(case, rasters)
                if twice:
                    same[name] = same.get(name, True) and digest_rasters(make()) == digest_rasters(rasters)
            by_meshlab = partial(
                texture_by_meshlab, place, environments, case.scene.mesh, case.images, case.poses, case.texels
            )
            try:
                texture, used = by_meshlab()
                if twice:
                    again, _ = by_meshlab()
                    equal = np.array_equal(again.image, texture.image) and np.array_equal(again.uv, texture.uv)
                    same["meshlab"] = same.get("meshlab", True) and equal
            except RuntimeError as error:
                skipped["meshlab"] = str(error).splitlines()[-1]
            else:
                costs.setdefault("meshlab", []).append(used)
                samplers["meshlab"] = face_sampler(texture)
                faces.append(float((texture.uv != 0).any(axis=(1, 2)).mean()))
        compared = compare_views(case, samplers)
        views += compared
        if pictures is not None:
            write_pictures(compared, pictures.with_name(f"{pictures.name}-{number}"))
    told: dict[str, Any] = {"panoramas": len(cases[0].taken), "texels": cases[0].texels} | measure_likeness(views)
    told["pose_errors"] = pose_errors(
        [pose for case in cases for pose in case.poses], [one.pose for case in cases for one in case.taken]
    )
    told["cost"] = {
        name: {
            "seconds": round(mean(each, "seconds"), 1),
            "processor_seconds": round(mean(each, "processor_seconds"), 1),
            "memory_mb": round(max(one["memory_mb"] for one in each)),
        }
        for name, each in costs.items()
    }
    if faces:
        told["faces that meshlab textures"] = round(float(np.mean(faces)), 3)
    return told | ({"same_bytes": same} if twice else {}) | ({"skipped": skipped} if skipped else {})


def _write_panoramas(case: Case, folder: Path) -> list[Path]:
    """Write the pictures that texture a case, as a run reads them."""
    files = [folder / f"panorama-{number}.png" for number in range(len(case.images))]
    for file, image in zip(files, case.images, strict=True):
        cv2.imwrite(str(file), image[..., ::-1])
    return files


def mean(each: Sequence[dict[str, float]], key: str) -> float:
    """Return the mean of a cost over cases."""
    return float(np.mean([one[key] for one in each]))


def measure_cost(make: Callable[[], dict[int, np.ndarray]]) -> tuple[dict[int, np.ndarray], dict[str, float]]:
    """Call `make`; returns what it made, and seconds, processor seconds and the peak memory of this process, MB."""
    process, ended, peak = psutil.Process(), threading.Event(), [0]

    def look() -> None:
        while not ended.wait(LOOK_S):
            peak[0] = max(peak[0], process.memory_info().rss)

    watcher = threading.Thread(target=look)
    watcher.start()
    wall, processor = time.perf_counter(), time.process_time()
    made = make()
    used = {"seconds": time.perf_counter() - wall, "processor_seconds": time.process_time() - processor}
    ended.set()
    watcher.join()
    return made, used | {"memory_mb": peak[0] / 2**20}


def digest_rasters(rasters: dict[int, np.ndarray]) -> str:
    """Return the digest of the rasters of charts."""
    digest = hashlib.sha256()
    for chart in sorted(rasters):
        digest.update(np.ascontiguousarray(rasters[chart]).tobytes())
    return digest.hexdigest()


def write_pictures(views: Sequence[ComparedView], name: Path) -> None:
    """Write each view as a row: the truth, and each method."""
    name.parent.mkdir(parents=True, exist_ok=True)
    for number, view in enumerate(views):
        row = np.concatenate([view.truth, *view.made.values()], axis=1)
        cv2.imwrite(f"{name}-{number}.png", row[..., ::-1])


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
    parser.add_argument("--pictures", type=Path, help="folder for views: truth, ours, plain, meshlab")
    parser.add_argument(
        "--environments",
        type=Path,
        default=Path.home() / ".cache" / "streetloom" / "peers",
        help="folder for MeshLab's environment, made on demand: half a gigabyte",
    )
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
        told[name] = measure(each, options.environments, pictures, twice=options.twice)
        print(f"{name}: {json.dumps(told[name])}", file=sys.stderr)
    print(json.dumps(told | {"load": [round(load, 1), round(os.getloadavg()[0], 1)]}, indent=1))


if __name__ == "__main__":
    main()
