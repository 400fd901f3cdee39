"""Each method's texture of each case, compared with the picture held out, and what it costs."""

from __future__ import annotations

import hashlib
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

from benchmarks.imagery import pose_errors
from benchmarks.mesh_texturing.cases import Case
from benchmarks.mesh_texturing.comparison import (
    ComparedView,
    Sampler,
    chart_sampler,
    compare_views,
    measure_likeness,
)
from benchmarks.mesh_texturing.ours import texture_as_a_run, texture_by_best_view

# Seconds between two looks at the memory.
LOOK_S = 0.05


def measure_cases(cases: Sequence[Case], pictures: Path | None = None, *, twice: bool = False) -> dict[str, Any]:
    """Texture the cases by each method, and compare.

    `pictures` is a folder for their views; `twice` textures a second time and tells whether that makes the same bytes.
    """
    views: list[ComparedView] = []
    costs: dict[str, list[dict[str, float]]] = {}
    same: dict[str, bool] = {}
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
        compared = compare_views(case, samplers)
        views += compared
        if pictures is not None:
            write_pictures(compared, pictures.with_name(f"{pictures.name}-{number}"))
    result: dict[str, Any] = {"panoramas": len(cases[0].taken), "texels": cases[0].texels} | measure_likeness(views)
    result["pose_errors"] = pose_errors(
        [pose for case in cases for pose in case.poses], [one.pose for case in cases for one in case.taken]
    )
    result["cost"] = {
        name: {
            "seconds": round(mean(each, "seconds"), 1),
            "processor_seconds": round(mean(each, "processor_seconds"), 1),
            "memory_mb": round(max(one["memory_mb"] for one in each)),
        }
        for name, each in costs.items()
    }
    return result | ({"same_bytes": same} if twice else {})


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
