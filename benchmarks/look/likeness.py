"""How like photographs views are: a kernel distance of a network's features, and how much detail walls show by distance."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

from benchmarks.look.photos import PANORAMAS, panorama_places, perspective, read_picture, real_paths, real_views
from benchmarks.look.views import PITCH, SIZE, View
from facade_core.geometry.charts import Charts

SUBSETS, SUBSET = 50, 40
# Metres from the camera, and the shares of each by which a pixel of it may be nearer or farther.
DISTANCES = (5.0, 15.0, 40.0)
_SPREAD = (0.7, 1.4)
# Walls are compared from this height on: lower down photos have cars and people before them.
FREE_M = 2.5
# Over the ground, of the cars that took the panoramas. That of wall_feet.json's points follows from it, within a sixth or so.
CAMERA_M = 2.3
# Yaws at which panoramas are cut for this.
_YAWS = (0, 72, 144, 216, 288)


def sets_of_features(data: Path, features: Callable[[Sequence[np.ndarray]], np.ndarray]) -> dict[str, np.ndarray]:
    """Features (n, k) of the real views, by the names of their sets."""
    found: dict[str, list[np.ndarray]] = defaultdict(list)
    for name, picture in real_views(data):
        found[name].append(features([picture])[0])
    return {name: np.array(rows) for name, rows in found.items()}


def distances(features: Sequence[np.ndarray], theirs: dict[str, np.ndarray], seed: int) -> dict[str, dict[str, float]]:
    """Kernel distances of features (n, k) to those of sets of photos and to all of them, each with the standard
    deviation over SUBSETS random subsets of SUBSET of either side."""
    from training.translator.kernel_distance import kernel_distance

    ours = np.array(features)
    rng = np.random.default_rng(seed)
    found = {}
    for name, real in {**theirs, "all": np.concatenate(list(theirs.values()))}.items():
        drawn = [
            kernel_distance(*(one[rng.choice(len(one), min(SUBSET, len(one)), replace=False)] for one in (ours, real)))
            for _ in range(SUBSETS)
        ]
        found[name] = {
            "distance": round(kernel_distance(ours, real), 1),
            "deviation": round(float(np.std(drawn)), 1),
        }
    return found


def between_photos(theirs: dict[str, np.ndarray]) -> dict[str, float]:
    """Kernel distances between the sets of photos themselves: what a real street's could be."""
    from training.translator.kernel_distance import kernel_distance

    names = sorted(theirs)
    return {
        f"{a}, {b}": round(kernel_distance(theirs[a], theirs[b]), 1)
        for i, a in enumerate(names)
        for b in names[i + 1 :]
    }


def gradient_energy(rgb: np.ndarray, distance: np.ndarray, wall: np.ndarray) -> dict[float, tuple[float, float, int]]:
    """By DISTANCES: the sum of squared gradients of brightness, the sum of brightness, and the number of pixels.

    rgb (h, w, 3) uint8; distance (h, w) metres; wall (h, w) bool, pixels whose neighbours show the same wall too.
    """
    grey = rgb.astype(np.float32) @ np.array([0.299, 0.587, 0.114], np.float32)
    down, right = np.gradient(grey, axis=0), np.gradient(grey, axis=1)
    energy = down**2 + right**2
    found = {}
    for metres in DISTANCES:
        here = wall & (distance > metres * _SPREAD[0]) & (distance < metres * _SPREAD[1])
        found[metres] = (float(energy[here].sum()), float(grey[here].sum()), int(here.sum()))
    return found


def relative_energy(
    parts: Iterable[dict[float, tuple[float, float, int]]],
) -> dict[float, tuple[float | None, int]]:
    """Mean squared gradient over the squared mean brightness, and of how many pixels, by distance."""
    total: dict[float, np.ndarray] = {metres: np.zeros(3) for metres in DISTANCES}
    for part in parts:
        for metres, sums in part.items():
            total[metres] += np.array(sums)
    return {
        metres: (float(energy * count / brightness**2) if brightness > 0 else None, int(count))
        for metres, (energy, brightness, count) in total.items()
    }


def rendered_energy(view: View, charts: Charts, walls: np.ndarray) -> dict[float, tuple[float, float, int]]:
    """That of the walls (k,) which a view shows."""
    inside = np.isin(view.chart, walls)
    same = inside.copy()
    for axis in (0, 1):
        for step in (-1, 1):
            same &= np.roll(charts.surface[view.chart] * inside, step, axis) == charts.surface[view.chart] * inside
    same[[0, -1]], same[:, [0, -1]] = False, False
    return gradient_energy(view.rgb, view.distance, same & (view.above > FREE_M))


def real_energy(data: Path) -> list[dict[float, tuple[float, float, int]]]:
    """That of the walls of held-out panoramas which are marked in wall_feet.json.

    It holds, by panorama, walls as x, y, x, y, left, right, low, high: two points of a wall's foot and the columns between
    which it is clear of others, in pixels of 4096 x 2048, and the heights in metres between which nothing stands before it;
    marked by eye.
    """
    marked = json.loads(Path(__file__).with_name("wall_feet.json").read_text(encoding="utf-8"))
    found = []
    for path in real_paths(data, PANORAMAS):
        if path.stem not in marked:
            continue
        panorama = read_picture(path)
        for yaw in _YAWS:
            rgb = perspective(panorama, yaw, PITCH)
            u, v = panorama_places(yaw, PITCH, SIZE, samples=1)
            nearest = np.full(SIZE, np.inf)
            for wall in marked[path.stem]:
                np.minimum(nearest, _wall_distance(u, v, wall), out=nearest)
            found.append(gradient_energy(rgb, nearest, _eroded(np.isfinite(nearest))))
    return found


def _wall_distance(u: np.ndarray, v: np.ndarray, wall: Sequence[float]) -> np.ndarray:
    """Metres to a marked wall along rays at shares (h, w) of the panorama, inf beside it."""
    x0, y0, x1, y1, left, right, low, high = wall
    azimuth, elevation = (u - 0.5) * 2 * np.pi, (0.5 - v) * np.pi
    feet = []
    for x, y in ((x0, y0), (x1, y1)):
        away, turn = CAMERA_M / np.tan((y / 2048 - 0.5) * np.pi), (x / 4096 - 0.5) * 2 * np.pi
        feet.append(away * np.array([np.sin(turn), np.cos(turn)]))
    along = feet[1] - feet[0]
    normal = np.array([along[1], -along[0]]) / np.linalg.norm(along)
    facing = np.sin(azimuth) * normal[0] + np.cos(azimuth) * normal[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        level = (feet[0] @ normal) / facing
    height = CAMERA_M + level * np.tan(elevation)
    inside = (u * 4096 > left) & (u * 4096 < right) & (level > 0) & (height > low) & (height < high)
    return np.where(inside, level / np.cos(elevation), np.inf)


def _eroded(mask: np.ndarray) -> np.ndarray:
    import cv2

    return cv2.erode(mask.astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=0).astype(bool)
