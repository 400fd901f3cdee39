"""Synthesis and retargeting of facades: `python -m benchmarks.synthesis --data DIR` prints one JSON object.

Five ECP facades of 700 x 500 px laid anew by 5000 generations: processor seconds on one core; lowest energy (Eq. 4)
after some generations, as the tiles paper's Fig. 6; the final energy over seeds beside that of the same algorithm
written out plainly, every energy computed whole. --picture FILE shows ten facades retargeted, beside image quilting and
seam carving to the same size, from the sets whose licence allows it (ecp MIT, cmp CC BY-SA).
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.papers.tile_search import search_plainly
from facade_core.core.labels import UNKNOWN, FacadeClass
from facade_core.facade.texture.retargeting import retarget
from facade_core.facade.texture.scale import exemplar_scale
from facade_core.facade.texture.settings import SYNTHESIS
from facade_core.facade.texture.synthesis import evolve_random_tilings, synthesize_on_lattice
from facade_core.facade.texture.tiling_energy import tabulate_energy
from facade_core.parsing.floor_structure import find_floors_and_bays
from facade_core.parsing.lattice import lattice
from training.datasets.facades import ECP, LabelledFacade, read_dataset

FACADES = ("monge_10", "monge_26", "monge_55", "monge_74", "monge_107")
SIZE = (700, 500)
WALLS = (((12.0, 9.0), 3), ((19.0, 24.0), 6), ((16.0, 8.0), 4), ((25.0, 14.0), 8))
SHOWN = tuple(f"monge_{n}" for n in (10, 21, 26, 40, 55, 63, 68, 74, 87, 107))
_AFTER = (0, 10, 30, 100, 300, 1000, 3000, 5000)


def resized(facade: LabelledFacade, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Image and labels of size (H, W); what has no class is wall."""
    import cv2

    labels = np.where(facade.labels == UNKNOWN, FacadeClass.WALL, facade.labels).astype(np.uint8)
    image = cv2.resize(facade.image, size[::-1], interpolation=cv2.INTER_AREA)
    return image, cv2.resize(labels, size[::-1], interpolation=cv2.INTER_NEAREST)


def timed(call: Callable[[], Any]) -> tuple[float, Any]:
    """Processor seconds of this process, which on a shared machine say more than the clock."""
    start = time.process_time()
    result = call()
    return round(time.process_time() - start, 3), result


def measure(facades: Sequence[LabelledFacade], *, seeds: int, generations: int) -> dict[str, Any]:
    """Seconds, the curve of the first facade, energies beside the reference's, and seconds of retargeting."""
    first = resized(facades[0], SIZE)
    synthesize_on_lattice(*first, lattice(first[1]), (200, 200), generations=2)  # compiles
    seconds, energies = [], []
    for facade in facades:
        image, labels = resized(facade, SIZE)
        make = partial(synthesize_on_lattice, image, labels, lattice(labels), SIZE, seed=1, generations=generations)
        taken, made = timed(make)
        seconds.append(taken)
        energies.append(round(made.energy, 2))
    image, labels = first
    grid = lattice(labels)
    tab = tabulate_energy(image, labels, grid)
    shape = len(grid.rows) - 1, len(grid.columns) - 1
    runs = [evolve_random_tilings(tab, grid, shape, np.random.default_rng(s), generations)[1] for s in range(seeds)]
    plain = [search_plainly(tab, shape, grid, generations, s) for s in range(seeds)]
    walls = []
    for facade in facades:
        label_map = np.where(facade.labels == UNKNOWN, FacadeClass.WALL, facade.labels).astype(np.uint8)
        scale = exemplar_scale(facade.image, label_map)
        for size, floors in WALLS:
            fit = partial(retarget, facade.image, label_map, size, floors=floors, metres_per_pixel=scale)
            walls.append(timed(fit)[0])
    return {
        "generations": generations,
        "tiles": shape[0] * shape[1],
        "seconds": dict(zip((f.name for f in facades), seconds, strict=True)),
        "energy": dict(zip((f.name for f in facades), energies, strict=True)),
        "curve": {n: round(float(np.mean([run[n] for run in runs])), 2) for n in _AFTER if n <= generations},
        "final_energy_mean": round(float(np.mean([run[-1] for run in runs])), 2),
        "reference_energy_mean": round(float(np.mean(plain)), 2),
        "energy_ratio": round(float(np.mean([run[-1] for run in runs]) / np.mean(plain)), 3),
        "retarget_seconds_median": round(float(np.median(walls)), 3),
    }


def picture(data: Path, path: Path, *, height: int = 170) -> None:
    """A JPEG: in each row two exemplars, each beside quilting, seam carving and ours, half as wide again and a floor less."""
    import cv2
    from PIL import Image

    from benchmarks.synthesis.resizing import carve, quilt

    rows = []
    for facade in read_dataset(ECP, data / "facades" / "ecp"):
        if facade.name not in SHOWN:
            continue
        image, labels = resized(facade, (500, round(500 * facade.labels.shape[1] / facade.labels.shape[0])))
        scale = exemplar_scale(image, labels)
        found = find_floors_and_bays(labels)
        floors = max(2, len(found.floors) - 1 if found else 2)
        size = round(0.85 * image.shape[0]), round(1.5 * image.shape[1])
        metres = size[0] * scale, size[1] * scale
        ours = retarget(image, labels, metres, floors=floors, metres_per_pixel=scale, seed=1)[0].image
        made = [image, quilt(image, size, np.random.default_rng(0)), carve(image, size), ours]
        fitted = [
            cv2.resize(p, (round(p.shape[1] * height / p.shape[0]), height), interpolation=cv2.INTER_AREA) for p in made
        ]
        rows.append(np.concatenate([np.pad(p, ((0, 6), (0, 6), (0, 0)), constant_values=255) for p in fitted], 1))
    wide = max(row.shape[1] for row in rows) + 24
    rows = [np.pad(row, ((0, 0), (0, wide - row.shape[1]), (0, 0)), constant_values=255) for row in rows]
    half = -(-len(rows) // 2)
    rows += [np.full_like(rows[0], 255)] * (2 * half - len(rows))
    sheet = np.concatenate([np.concatenate([rows[k], rows[half + k]], 1) for k in range(half)])
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(sheet).save(path, quality=72, optimize=True)


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description="Synthesis from tiles: seconds, energies, and a picture beside others'."
    )
    parser.add_argument("--data", type=Path, default=Path(os.environ.get("STREETLOOM_DATA", "../shared/data")))
    parser.add_argument("--seeds", type=int, default=10, help="runs of ours and of the reference [10]")
    parser.add_argument("--generations", type=int, default=SYNTHESIS.generations)
    parser.add_argument("--picture", type=Path, help="write the picture to this file, and measure nothing")
    options = parser.parse_args(arguments)
    if options.picture:
        picture(options.data, options.picture)
        return
    chosen = [facade for facade in read_dataset(ECP, options.data / "facades" / "ecp") if facade.name in FACADES]
    figures = measure(chosen, seeds=options.seeds, generations=options.generations)
    print(json.dumps({"benchmark": "synthesis", **figures}))


if __name__ == "__main__":
    main()
