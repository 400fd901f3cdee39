"""0015: texels of planar charts to world points and panorama pixels, one by one and as arrays."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from benchmarks.timing import figures, once, seconds
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.types import Building, Street
from facade_core.geometry.block_surfaces import block_surfaces
from facade_core.geometry.chart_packing import pack
from facade_core.geometry.charts import Charts
from facade_core.geometry.equirectangular import project
from facade_core.geometry.ground.terrain import terrain_of
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint
from facade_core.street.propagation.propagate import propagate
from facade_core.street.propagation.texel_buffer import TexelBuffer

DENSITY = 20.0  # texels per metre
SIZE = 2048
HEIGHT_M = 12.0


def measure(quick: bool, data: Path | None) -> dict[str, Any]:
    """Nanoseconds per texel: the look-up in Python and in numpy, the whole shipped propagation; one remap of an atlas page."""
    import cv2

    repeats, size = (1, 256) if quick else (7, SIZE)
    scene, viewpoint = street_scene(3 if quick else 8)
    charts = scene.charts
    wall = int(np.argmax(charts.size[:, 0] * charts.size[:, 1]))
    width, height = (int(v) for v in charts.texels(DENSITY)[wall])
    part = (min(height, 40), min(width, 40 if quick else 200))
    slow = min(once(lambda: _one_by_one(charts, wall, part, viewpoint)) for _ in range(max(2, repeats // 2)))
    fast = seconds(
        lambda: project(_points(charts, wall, (height, width)), viewpoint.position, viewpoint.forward, 1024), repeats
    )
    np.testing.assert_allclose(
        _one_by_one(charts, wall, part, viewpoint),
        project(_points(charts, wall, part), viewpoint.position, viewpoint.forward, 1024)[0],
        atol=1e-6,
    )
    seen = scene.look(viewpoint, 1024)[2]
    held = np.unique(seen[seen >= 0])
    rasters, writable = TexelBuffer.layout(scene.placement, held, [])
    blank = np.zeros((rasters.total, 3), np.uint8)
    window = TexelBuffer.of(scene.placement, rasters, writable, blank, blank[:, 0].copy())
    rgb = np.random.default_rng(0).integers(0, 256, (512, 1024, 3), dtype=np.uint8)
    kernel = seconds(lambda: propagate(scene, window, viewpoint, rgb, seen=seen), repeats)
    u, v = np.meshgrid(np.linspace(0, 1023, size, dtype=np.float32), np.linspace(0, 511, size, dtype=np.float32))
    per_texel = {
        "python_loop_look_up": slow / (part[0] * part[1]),
        "numpy_look_up": fast / (height * width),
        "shipped_propagation": kernel / rasters.total,
    }
    return {
        "ns_per_texel": {name: figures(1e9 * s) for name, s in per_texel.items()},
        "texels_propagated": rasters.total,
        "python_over_numpy": figures(per_texel["python_loop_look_up"] / per_texel["numpy_look_up"]),
        "python_over_propagation": figures(per_texel["python_loop_look_up"] / per_texel["shipped_propagation"]),
        "remap": {"texels": size, "seconds": figures(seconds(lambda: cv2.remap(rgb, u, v, cv2.INTER_LINEAR), repeats))},
    }


def street_scene(houses: int) -> tuple[Scene, Viewpoint]:
    """A street between two rows of houses, and the viewpoint in its middle."""
    rows = [(side, i) for side in (0, 1) for i in range(houses)]
    buildings = [
        Building(f"{side}-{i}", shapely.box(16 * i, 24 * side, 16 * i + 15, 24 * side + 10), HEIGHT_M, "height")
        for side, i in rows
    ]
    street = Street("s", None, shapely.LineString([(0, 17), (16 * houses, 17)]))
    charts, mesh, _ = block_surfaces(buildings, [street], terrain=terrain_of([], None), ground_margin=20, largest=100)
    placement = pack(charts.size, DENSITY, charts.building, page=SIZE, chunk=128, gutter=2)
    viewpoint = Viewpoint(0, 0, np.array([8.0 * houses, 17.0, 2.5]), np.array([1.0, 0.0]))
    return Scene(mesh, charts, placement, AtlasSpec(placement.pages, DENSITY)), viewpoint


def _points(charts: Charts, chart: int, shape: tuple[int, int]) -> np.ndarray:
    """World points of the first rows and columns of a chart's texels: origin + x u + y v, (rows, columns, 3)."""
    y, x = ((np.arange(n) + 0.5) / DENSITY for n in shape)
    return charts.points(chart, x[None], y[:, None])


def _one_by_one(
    charts: Charts, chart: int, shape: tuple[int, int], viewpoint: Viewpoint
) -> list[list[tuple[float, float]]]:
    """The same look-up as plain Python: pixel (u, v) of every texel."""
    origin, right, down = (a[chart].tolist() for a in (charts.origin, charts.axis_u, charts.axis_v))
    camera, (fx, fy) = viewpoint.position.tolist(), viewpoint.forward.tolist()
    found = []
    for row in range(shape[0]):
        line = []
        for column in range(shape[1]):
            x, y = (column + 0.5) / DENSITY, (row + 0.5) / DENSITY
            px, py, pz = (origin[i] + x * right[i] + y * down[i] - camera[i] for i in range(3))
            across, ahead = fy * px - fx * py, fx * px + fy * py
            distance = math.sqrt(px * px + py * py + pz * pz)
            u = (math.atan2(across, ahead) / (2 * math.pi) + 0.5) * 1024
            line.append((u, (0.5 - math.asin(pz / distance) / math.pi) * 512))
        found.append(line)
    return found
