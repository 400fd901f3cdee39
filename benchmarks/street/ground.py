"""What a point of ground costs by the number of streets: distances alone, against all centrelines at once, and agreement.

python -m benchmarks.street.ground
"""

from __future__ import annotations

import json
import time
from typing import Any

import numpy as np
import shapely

from facade_core.street.centrelines import Centrelines
from facade_core.types import Street

# Metres within which a distance matters, and points asked for.
REACH, POINTS = 8.0, 200_000
# Points that are compared with shapely, which takes tens of microseconds each.
COMPARED = 5_000


def measure(counts: tuple[int, ...] = (3, 100, 1000)) -> dict[str, Any]:
    """us a point by number of streets, and how far the distances within reach are from shapely's."""
    rng = np.random.default_rng(0)
    found = {}
    for count in counts:
        side = 200 * np.sqrt(count)
        begin = rng.uniform(0, side, (count, 2))
        lines = shapely.linestrings(np.stack([begin, begin + rng.normal(0, 150, (count, 2))], axis=1))
        centrelines = Centrelines([Street(str(i), None, line) for i, line in enumerate(lines)], REACH)
        points = rng.uniform(0, side, (POINTS, 2))
        centrelines.distance(points[:10])  # compiles
        start = time.perf_counter()
        distance = centrelines.distance(points)
        grid = time.perf_counter() - start
        start = time.perf_counter()
        expected = shapely.distance(shapely.union_all(lines), shapely.points(points[:COMPARED]))
        whole = time.perf_counter() - start
        near = expected < REACH
        found[str(count)] = {
            "us": round(1e6 * grid / POINTS, 3),
            "us_against_all": round(1e6 * whole / COMPARED, 2),
            "largest_difference_m": float(np.abs(distance[:COMPARED][near] - expected[near]).max(initial=0.0)),
        }
    return found


def main() -> None:
    print(json.dumps(measure(), indent=2))


if __name__ == "__main__":
    main()
