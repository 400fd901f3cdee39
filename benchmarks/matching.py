"""Photos matched to the walls of painted streets: `python -m benchmarks.matching [--streets 3]` prints JSON.

Each facade is taken from the other side of its street as a person would: off its middle by up to 3 m, turned off it by up to
15 degrees, at 1.5 to 1.8 m over the ground, 75 degrees wide, with trees and cars before it. A photo states its place, off by
5 m; its heading too, off by 12 degrees; or one that lies by 90 degrees. right, wrong: of the photos that are sure; unclear:
those left to a person, and how many of these have the true facade among their candidates; lost: no facade is found there.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from typing import Any

import numpy as np

from benchmarks.painter.street_truth import SyntheticStreet, render_street_panorama, synthetic_street
from facade_core.core.errors import ImageError
from facade_core.core.types import Pose
from facade_core.geometry.charts import ChartKind
from facade_core.imagery.poses.photo_matching import estimate_orientation, match_walls
from facade_core.imagery.rectify.photo import rectify
from tasks.matching.settings import MATCHING

OUTCOMES = ("right", "wrong", "unclear, the true one told", "unclear", "lost")
WIDE_DEG, SIZE, PANORAMA = 75.0, (960, 1280), 4096


def photo_of(street: SyntheticStreet, chart: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, float]:
    """A photo (h, w, 3) of a wall from across the street, where it was taken (2,), and its heading."""
    charts = street.scene.charts
    width, height = charts.size[chart]
    normal, along = charts.normals()[chart], charts.axis_u[chart]
    foot = charts.points(chart, np.array([width / 2]), np.array([height]))[0]
    place = foot + 16.0 * normal + rng.uniform(-3, 3) * along
    toward = np.degrees(np.arctan2(foot[0] - place[0], foot[1] - place[1]))
    heading = float(toward + rng.uniform(-15, 15)) % 360
    pose = Pose(float(place[0]), float(place[1]), float(foot[2] + rng.uniform(1.5, 1.8)), heading)
    whole = render_street_panorama(street, pose, PANORAMA, seed=int(rng.integers(2**31)))
    rise = (height / 2 - 1.6) / 16.0
    return perspective(whole, float(rise)), place[:2], heading


def perspective(whole: np.ndarray, rise: float) -> np.ndarray:
    """What a pinhole camera sees of a panorama that looks at its middle column and as steeply up as `rise`."""
    import cv2

    height, width = SIZE
    focal = width / 2 / np.tan(np.radians(WIDE_DEG) / 2)
    x, y = np.meshgrid((np.arange(width) + 0.5 - width / 2) / focal, (height / 2 - np.arange(height) - 0.5) / focal)
    tilt = np.arctan(rise)
    ahead, up = np.cos(tilt) - y * np.sin(tilt), np.sin(tilt) + y * np.cos(tilt)
    longitude, latitude = np.arctan2(x, ahead), np.arctan2(up, np.hypot(x, ahead))
    rows, columns = whole.shape[:2]
    u, v = (longitude / (2 * np.pi) + 0.5) * columns - 0.5, (0.5 - latitude / np.pi) * rows - 0.5
    return cv2.remap(whole, u.astype(np.float32), v.astype(np.float32), cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)


def measure(streets: int, buildings: int) -> dict[str, Any]:
    """All photos of some streets."""
    told: dict[str, Counter[str]] = {
        name: Counter(dict.fromkeys(OUTCOMES, 0)) for name in ("place", "place and heading", "heading lies")
    }
    seconds = []
    for seed in range(streets):
        street = synthetic_street(buildings, seed=seed, occluders=2)
        charts = street.scene.charts
        walls = np.flatnonzero((charts.kind == ChartKind.WALL) & (charts.size.min(axis=1) > 3))
        for chart in street.charts:
            rng = np.random.default_rng([seed, chart])
            photo, place, heading = photo_of(street, chart, rng)
            begun = time.perf_counter()
            try:
                found = rectify(photo)
                taken = estimate_orientation(found.image, found.seen, found.homography, found.focal, photo.shape[:2])
            except ImageError:
                taken = None
            near = np.append(place + rng.normal(0, 5 / np.sqrt(2), 2), 0.0)
            turned = heading + rng.normal(0, 12)
            stated = {"place": None, "place and heading": turned, "heading lies": turned + 90}
            for name, counts in told.items():
                if taken is None:
                    counts["lost"] += 1
                    continue
                likely = match_walls(street.scene, walls, taken, near, stated[name], seed=0).probability
                counts[_outcome(walls, likely, chart)] += 1
            seconds.append(time.perf_counter() - begun)
    return {name: dict(sorted(counts.items())) for name, counts in told.items()} | {
        "photos": len(seconds),
        "seconds a photo": round(float(np.median(seconds)), 2),
    }


def _outcome(walls: np.ndarray, likely: np.ndarray, truth: int) -> str:
    order = np.argsort(-likely, kind="stable")[: MATCHING.max_candidates]
    if likely[order[0]] >= MATCHING.min_certain_probability:
        return "right" if walls[order[0]] == truth else "wrong"
    return (
        "unclear, the true one told" if truth in walls[order[likely[order] >= MATCHING.min_probability]] else "unclear"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--streets", type=int, default=3)
    parser.add_argument("--buildings", type=int, default=12)
    options = parser.parse_args()
    print(json.dumps({"benchmark": "matching"} | measure(options.streets, options.buildings), indent=1))


if __name__ == "__main__":
    main()
