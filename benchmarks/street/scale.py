"""The step on the whole of Lyon against the step on a cut-out of it: the same streets, the same viewpoints."""

from __future__ import annotations

import resource
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from benchmarks.street.step import cameras, steps
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.types import Street
from facade_core.geometry.chart_packing import pack_charts
from facade_core.geometry.charts import ChartBuilder, ChartKind, chart_axes_right_down
from facade_core.geometry.ground.street_gaps import derive_streets
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint

TEXELS_PER_METRE = 20.0
BUILDINGS = 200
STREETS, VIEWPOINTS = 2, 16
# Surfaces are cut by the middles of their triangles; longer triangles would not fit a page.
CELL_M, LONGEST_M = 24.0, 70.0
WELD_M = 0.01
UPRIGHT = 0.5


def measure(path: Path) -> dict[str, Any]:
    """Steps on the cut-out and on the city, their ratio, the atlas that the city declares, and peak memory."""
    with np.load(path) as file:
        triangles, surface = file["triangles"].astype(np.float64), file["feature"].astype(np.int64)
    extent = np.ptp(triangles, axis=1).max(axis=1)
    sound = (np.linalg.norm(_normal(triangles), axis=1) > 1e-3) & (extent < LONGEST_M)
    triangles, surface = triangles[sound], surface[sound]
    building = _buildings(triangles)
    chosen = _middle(triangles, building)
    inside = np.isin(building, chosen)
    streets, ground = _streets(triangles[inside], building[inside])
    result: dict[str, Any] = {}
    for name, part in {"cut_out": inside, "city": np.ones(len(inside), bool)}.items():
        start = time.perf_counter()
        scene = _scene(triangles[part], surface[part], building[part], streets, ground)
        made = time.perf_counter() - start
        own = _viewpoints(streets, ground)
        scene.visible_charts(own[0], 64)  # the ray caster builds its tree
        result[name] = steps(scene, streets, own) | {
            "triangles": len(scene.mesh.triangles),
            "buildings": len(np.unique(building[part])),
            "charts": len(scene.charts),
            "gigatexels_declared": round(scene.spec.pages * scene.spec.page**2 / 1e9, 2),
            "seconds_to_make": round(made, 1),
        }
    clocks = [("wall", lambda one: one["seconds"]["render + propagate"])]
    clocks += [("processor", lambda one: one["processor_seconds_render_propagate"])]
    result["city_over_cut_out"] = {name: round(of(result["city"]) / of(result["cut_out"]), 2) for name, of in clocks}
    result["peak_memory_gb"] = round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6, 2)
    return result


def _normal(triangles: np.ndarray) -> np.ndarray:
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


def _buildings(triangles: np.ndarray) -> np.ndarray:
    """Which connected part each triangle (t, 3, 3) belongs to, (t,)."""
    corners = np.round(triangles.reshape(-1, 3) / WELD_M).astype(np.int64)
    corners -= corners.min(axis=0)
    code = (corners[:, 0] << 42) | (corners[:, 1] << 20) | corners[:, 2]
    vertex = np.unique(code, return_inverse=True)[1].reshape(-1, 3)
    ends = np.concatenate([vertex[:, [0, 1]], vertex[:, [0, 2]]])
    count = int(vertex.max()) + 1
    graph = coo_matrix((np.ones(len(ends), bool), (ends[:, 0], ends[:, 1])), shape=(count, count))
    return connected_components(graph, directed=False)[1][vertex[:, 0]]


def _middle(triangles: np.ndarray, building: np.ndarray) -> np.ndarray:
    """The buildings nearest to the median building."""
    count = int(building.max()) + 1
    size = np.maximum(np.bincount(building, minlength=count), 1)
    middles = triangles[:, :, :2].mean(axis=1)
    place = np.column_stack([np.bincount(building, middles[:, i], count) / size for i in (0, 1)])
    away = np.abs(place - np.median(place, axis=0)).max(axis=1)
    return np.argsort(away, kind="stable")[:BUILDINGS]


def _streets(triangles: np.ndarray, building: np.ndarray) -> tuple[list[Street], float]:
    """The longest streets along the gaps within the middle half of the cut-out, and the level of the ground there."""
    outlines = []
    for one in np.unique(building):
        flat = [shapely.Polygon(t[:, :2]) for t in triangles[building == one]]
        outline = shapely.union_all([p for p in flat if p.area > 1e-3]).buffer(0.1)
        outlines += [part for part in shapely.get_parts(outline) if part.area > 10]
    found = derive_streets(outlines)
    west, south, east, north = shapely.union_all(outlines).bounds
    middle = np.array([(west + east) / 2, (south + north) / 2])
    half = np.array([east - west, north - south]) / 4
    near = [s for s in found if (np.abs(np.array(s.line.centroid.coords[0]) - middle) < half).all()]
    longest = sorted(near, key=lambda s: (-s.line.length, s.id))[:STREETS]
    level = float(np.median([triangles[building == one][..., 2].min() for one in np.unique(building)]))
    return longest, level


def _scene(
    triangles: np.ndarray, surface: np.ndarray, building: np.ndarray, streets: list[Street], level: float
) -> Scene:
    """Every surface cut on a grid into planar charts, and level ground around the streets."""
    middle = np.floor(triangles[:, :, :2].mean(axis=1) / CELL_M).astype(np.int64)
    _, chart = np.unique(np.column_stack([surface, middle]), axis=0, return_inverse=True)
    order = np.argsort(chart, kind="stable")
    triangles, building, chart = triangles[order], building[order], chart[order]
    normal = _normal(triangles)
    normal = np.column_stack([np.bincount(chart, normal[:, i]) for i in range(3)])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.where(length > 1e-6, normal / np.maximum(length, 1e-6), [0.0, 0.0, 1.0])
    kind = np.where(np.abs(normal[:, 2]) < UPRIGHT, ChartKind.WALL, ChartKind.ROOF)
    pieces = ChartBuilder()
    corners = np.arange(3 * len(triangles)).reshape(-1, 3)
    pieces.add_surfaces(
        kind, np.arange(len(kind)), 0, *chart_axes_right_down(normal), triangles.reshape(-1, 3), corners, chart
    )
    cells = _ground_cells(streets)
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]]) * CELL_M
    floor = np.dstack([cells[:, None] * CELL_M + square, np.full((len(cells), 6), level)]).reshape(-1, 3)
    up = np.tile([0.0, 0.0, 1.0], (len(cells), 1))
    numbers = np.arange(6 * len(cells)).reshape(-1, 3)
    kinds = np.full(len(cells), ChartKind.GROUND)
    pieces.add_surfaces(
        kinds,
        np.arange(len(cells)),
        -1,
        *chart_axes_right_down(up),
        floor,
        numbers,
        np.repeat(np.arange(len(cells)), 2),
    )
    charts, mesh = pieces.build()
    owner = charts.building.copy()
    owner[chart] = building
    charts = replace(charts, building=owner)
    placement = pack_charts(charts.size, TEXELS_PER_METRE, owner, page=2048, chunk=128, gutter=2)
    return Scene(mesh, charts, placement, AtlasSpec(placement.pages, TEXELS_PER_METRE))


def _ground_cells(streets: list[Street]) -> np.ndarray:
    """Cells of the grid (n, 2) within reach of the streets."""
    near = shapely.union_all([street.line.buffer(40.0) for street in streets])
    west, south, east, north = (int(v // CELL_M) for v in near.bounds)
    x, y = np.meshgrid(np.arange(west, east + 1), np.arange(south, north + 1))
    cells = np.column_stack([x.ravel(), y.ravel()])
    boxes = shapely.box(*(cells * CELL_M).T, *((cells + 1) * CELL_M).T)
    return cells[shapely.intersects(near, boxes)]


def _viewpoints(streets: list[Street], level: float) -> list[Viewpoint]:
    own: list[Viewpoint] = []
    for number, street in enumerate(streets):
        found = cameras(street, lambda points: np.full(len(points), level), first=len(own), number=number)
        own += found[: VIEWPOINTS // STREETS]
    return own
