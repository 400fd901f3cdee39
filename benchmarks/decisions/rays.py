"""0016: panoramas cast on growing scenes, what a viewpoint sees of them, and two ways to pack charts."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from benchmarks.timing import figures, once, seconds
from facade_core.geometry.chart_packing import pack
from facade_core.geometry.charts import Mesh
from facade_core.geometry.equirectangular import directions
from facade_core.geometry.raycast import RayCaster

RANGE_M = 40.0
STREET_M = 5.0  # to the nearest wall
PITCH_M = 24.0  # of the houses' grid: 14 m of house, 10 m of street
_CORNERS = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
_QUADS = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6]])


def measure(quick: bool, data: Path | None) -> dict[str, Any]:
    """Processor time by number of triangles, one thread, the city of the data folder where given; charts packed two ways."""
    counts, repeats = ((1_200,), 1) if quick else ((10_000, 100_000, 1_000_000), 5)
    scenes = {f"{n}_triangles": _scene(_houses(n // 12), repeats, quick) for n in counts}
    if data is not None:
        scenes["lyon"] = _scene(_lyon(data / "city" / "lyon" / "lod2.npz"), repeats, quick)
    return {"scenes": scenes, "packing": _packing(200 if quick else 2000, repeats)}


def _houses(count: int) -> Mesh:
    """A square grid of houses of varied heights, a chart per side; 12 triangles each."""
    side = int(np.ceil(np.sqrt(count)))
    place = np.stack(np.divmod(np.arange(count), side), axis=1) - side // 2
    base = np.column_stack([place * PITCH_M + (PITCH_M - 14) / 2, np.zeros(count)])
    size = np.column_stack([np.full((count, 2), 14.0), np.random.default_rng(0).uniform(6, 24, count)])
    quads = (base[:, None] + _CORNERS * size[:, None])[:, _QUADS].reshape(-1, 4, 3)
    return _mesh(quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3, 3), np.repeat(np.arange(6 * count), 2))


def _lyon(path: Path) -> Mesh:
    with np.load(path) as city:
        return _mesh(city["triangles"].astype(float), np.unique(city["feature"], return_inverse=True)[1])


def _mesh(triangles: np.ndarray, chart: np.ndarray) -> Mesh:
    corners = np.arange(3 * len(triangles), dtype=np.int32).reshape(-1, 3)
    chart = chart.astype(np.int32)
    return Mesh(triangles.reshape(-1, 3), corners, chart, np.repeat(chart, 3))


def _scene(mesh: Mesh, repeats: int, quick: bool) -> dict[str, Any]:
    """Figures of one scene, seen from 2.5 m above its ground in the middle."""
    caster = RayCaster(mesh)  # imports Open3D
    up = np.array([[0.0, 0.0, 1.0]])
    build = once(lambda: RayCaster(mesh).cast(caster.centre, up), clock=process_time)  # the first ray builds its tree
    viewpoint = _free_place(mesh, caster)
    casts = {f"{w}x{w // 2}_ms": _cast_ms(caster, viewpoint, w, repeats) for w in ((64,) if quick else (512, 2048))}
    depth, chart = caster.cast(viewpoint, directions(np.array([1.0, 0.0]), 512))
    return {
        "triangles": len(mesh.triangles),
        "build_seconds": figures(build),
        **casts,
        "charts": int(mesh.chart.max()) + 1,
        "charts_seen_within_40_m": len(np.unique(chart[(chart >= 0) & (depth <= RANGE_M)])),
        "million_occlusion_rays_seconds": _occlusion(caster, viewpoint, 10_000 if quick else 1_000_000),
    }


def _cast_ms(caster: RayCaster, viewpoint: np.ndarray, width: int, repeats: int) -> float:
    rays = directions(np.array([1.0, 0.0]), width)
    return figures(1000 * seconds(lambda: caster.cast(viewpoint, rays), repeats, clock=process_time))


def _free_place(mesh: Mesh, caster: RayCaster) -> np.ndarray:
    """The place near the middle with nothing above it that is most like a street, 2.5 m above the lowest vertex around."""
    middle = np.median(mesh.vertices[:, :2], axis=0)
    distance = np.hypot(*(mesh.vertices[:, :2] - middle).T)
    around = mesh.vertices[np.argpartition(distance, min(2000, len(distance) - 1))[:2000]]
    shifts = np.random.default_rng(1).normal(0, PITCH_M, (256, 2))
    places = np.column_stack([np.median(around[:, :2], axis=0) + shifts, np.full(256, around[:, 2].min() + 2.5)])
    angle = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    level = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(16)])
    clear = caster.cast(places[:, None], np.tile(level, (256, 1, 1)))[0].min(axis=1)
    covered = np.isfinite(caster.cast(places, np.tile([0.0, 0.0, 1.0], (256, 1)))[0])
    return places[np.argmin(np.abs(np.where(covered, np.inf, clear) - STREET_M))]


def _occlusion(caster: RayCaster, viewpoint: np.ndarray, rays: int) -> float:
    """Seconds per million rays from the points that the viewpoint sees back to it, in the order of its pixels."""
    width = int(np.sqrt(2 * rays)) // 2 * 2
    towards = directions(np.array([1.0, 0.0]), width).reshape(-1, 3)
    depth = caster.cast(viewpoint, towards)[0]
    hit = np.isfinite(depth)
    points = viewpoint + 0.999 * depth[hit, None] * towards[hit]
    return figures(1e6 * once(lambda: caster.cast(points, viewpoint - points), clock=process_time) / len(points))


def _packing(rectangles: int, repeats: int) -> dict[str, Any]:
    """Facade-like rectangles into pages, and the same rectangles as a mesh through xatlas where it can be imported."""
    rng = np.random.default_rng(0)
    texels = np.column_stack([rng.integers(60, 500, rectangles), rng.integers(100, 480, rectangles)])
    owner = np.repeat(np.arange(-(-rectangles // 4)), 4)[:rectangles]
    placement = pack(texels, 1.0, owner, page=2048, chunk=128, gutter=2)
    planar = seconds(lambda: pack(texels, 1.0, owner, page=2048, chunk=128, gutter=2), repeats)
    result: dict[str, Any] = {
        "charts": rectangles,
        "planar_ms": figures(1000 * planar),
        "planar_filled": figures(texels.prod(axis=1).sum() / (placement.pages * 2048**2)),
    }
    if importlib.util.find_spec("xatlas") is None:
        return result | {"xatlas": "absent"}
    import xatlas

    # rectangles apart from each other, so that each is a chart of its own for xatlas too
    start = np.column_stack([np.cumsum(texels[:, 0] + 100), np.zeros((rectangles, 2))])
    shape = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    points = start[:, None] + np.pad(shape * texels[:, None], ((0, 0), (0, 0), (0, 1)))
    faces = (4 * np.arange(rectangles)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    packing = xatlas.PackOptions()
    packing.padding, packing.resolution, packing.texels_per_unit = 2, 2048, 1.0

    def unwrap() -> None:
        atlas = xatlas.Atlas()
        atlas.add_mesh((points.reshape(-1, 3) / 20).astype(np.float32), faces.astype(np.uint32))
        packing.texels_per_unit = 20.0
        atlas.generate(pack_options=packing)
        result["xatlas_charts"] = atlas.chart_count
        result["xatlas_filled"] = figures(float(np.mean([atlas.get_utilization(i) for i in range(atlas.atlas_count)])))

    slow = once(unwrap)
    return result | {"xatlas_ms": figures(1000 * slow), "xatlas_over_planar": figures(slow / planar)}
