"""What the ground costs by the number of streets: drawing a square of it, and a texel of that; at a junction too.

python -m benchmarks.street.ground
"""

from __future__ import annotations

import json
import time
from typing import Any

import numpy as np
import shapely
from numba import njit

from facade_core.core.types import GroundWay, MappedGround
from facade_core.geometry.charts import ChartKind, Charts
from facade_core.geometry.ground.settings import SHAPES
from facade_core.geometry.ground.shapes import GroundTileArrays, GroundTiles
from facade_core.street.materials.grain import GrainTables
from facade_core.street.materials.grain_file import load_shipped_grain_tables
from facade_core.street.materials.ground_kernels import ground_colour
from facade_core.street.materials.pictured_ground import PicturedGround, learn_pictured_ground
from facade_core.street.materials.procedural import SURFACE_COLOURS

# Texels a metre, along a side of a square; texels that are worked out together.
DENSITY, SIDE = 16.0, 512
PIECE = 256
REPEATED = 5


def measure(counts: tuple[int, ...] = (3, 100, 1000)) -> dict[str, Any]:
    """By the number of streets: ms to draw a square, ns a texel of the middle one, and of one without a street."""
    found = {}
    unpictured = learn_pictured_ground([], len(SURFACE_COLOURS))
    for count in counts:
        side = np.sqrt(count) * 200
        rng = np.random.default_rng(0)
        begin = np.concatenate([rng.uniform(0, side, (count - 2, 2)), [[-60.0, 16.0], [14.0, -60.0]]])
        end = np.concatenate([begin[:-2] + rng.normal(0, 150, (count - 2, 2)), [[90.0, 19.0], [16.0, 90.0]]])
        lines = shapely.linestrings(np.stack([begin, end], axis=1))
        made = ("asphalt", "setts")
        ways = tuple(
            GroundWay(str(i), line, "road", 9.0, made[i % 2], lanes=2, pavement=(4.0, 4.0), rank=i % 5)
            for i, line in enumerate(lines)
        )
        places = np.array([[0.0, SHAPES.ground_tile_m, 0.0], [-10_016.0, SHAPES.ground_tile_m, 0.0]])
        squares = GroundTiles(MappedGround(ways), _charts(places))
        start = time.thread_time()
        squares.build_arrays([0])
        drawn = time.thread_time() - start
        times = {}
        for name, chart in (("junction", 0), ("nothing", 1)):
            near, low = squares.build_arrays([chart]), np.array([places[chart, 0], 0.0])
            _raster(near, load_shipped_grain_tables(), unpictured, *low)  # compiles
            taken = []
            for _ in range(REPEATED):
                start = time.thread_time()
                _raster(near, load_shipped_grain_tables(), unpictured, *low)
                taken.append(time.thread_time() - start)
            times[name] = round(1e9 * min(taken) / SIDE**2, 1)
        found[str(count)] = {"ms_a_square": round(1e3 * drawn, 1), "ns_a_texel": times}
    return found


def _charts(places: np.ndarray) -> Charts:
    """Squares of ground with their north-west corners at places (n, 3)."""
    count = len(places)
    own = np.arange(count, dtype=np.int32)
    east, south = (np.tile(axis, (count, 1)) for axis in ([1.0, 0.0, 0.0], [0.0, -1.0, 0.0]))
    kind = np.full(count, ChartKind.GROUND, np.uint8)
    return Charts(
        kind, own, np.full(count, -1, np.int32), places, east, south, np.full((count, 2), SHAPES.ground_tile_m)
    )


@njit(nogil=True)
def _raster(
    drawn: GroundTileArrays, grains: GrainTables, unpictured: PicturedGround, left: float, bottom: float
) -> None:
    side, light, out = np.full(PIECE, 1 / DENSITY), np.ones(PIECE), np.empty((PIECE, 3), np.uint8)
    for row in range(SIDE):
        y = np.full(PIECE, bottom + (row + 0.5) / DENSITY)
        for start in range(0, SIDE, PIECE):
            ground_colour(
                0,
                left + (start + np.arange(PIECE, dtype=np.float64) + 0.5) / DENSITY,
                y,
                side,
                drawn,
                grains,
                unpictured,
                7,
                light,
                1.0,
                out,
            )


def main() -> None:
    print(json.dumps(measure(), indent=2))


if __name__ == "__main__":
    main()
