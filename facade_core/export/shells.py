"""Simplified shells of buildings for views from afar: outlines extruded to one height, with the buildings' look baked on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import Polygon

from facade_core.export.baking import bake
from facade_core.export.models import Textured, grouped, shown_area
from facade_core.geometry.charts import ROOF, WALL, Charts, Mesh, Pieces
from facade_core.geometry.ground import add_level, add_planar

# Corners nearer than this to their neighbours' line are left out of an outline, and smaller courtyards are closed.
TOLERANCE_M = 1.0
# The shell's roof is above this share of the roofs' area.
ROOF_SHARE = 0.7
# A building of which roofs leave the shell by more than this keeps its own surfaces.
OFF_M = 4.0

_DOWN = np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True)
class Shells:
    """Shells with rasters; kept (k,), the buildings without one; off, metres, the most that a shell leaves its building."""

    textured: Textured
    kept: np.ndarray
    off: float


def simplified_shells(source: Textured, density: float, tell: Callable[[], None] = lambda: None) -> Shells:
    """A shell for every building, with rasters of `density` texels per metre; `tell` is called after each building."""
    pieces, kept, off = Pieces(), [], 0.0
    triangles = grouped(source.charts.building[source.mesh.chart])
    for building, mine in triangles.items():
        if building < 0:
            continue
        body = _body(source, mine)
        if body is None:
            kept.append(building)
            tell()
            continue
        outline, base, top, apart = body
        off = max(off, apart)
        _extrude(pieces, building, outline, base, top)
    charts, mesh = pieces.values() if len(pieces) else _nothing()
    texels = charts.texels(density)
    rasters: dict[int, np.ndarray] = {}
    for building, mine in grouped(charts.building).items():
        rasters |= bake(source, triangles[building], charts, mine, texels, density)
        tell()
    return Shells(Textured(charts, mesh, texels / density, texels, rasters.__getitem__), np.array(kept, np.int64), off)


def _body(source: Textured, triangles: np.ndarray) -> tuple[Polygon, float, float, float] | None:
    """Outline, base and top of a building's shell, and how far it leaves the roofs; None where it would leave them too far."""
    mesh = source.mesh
    roof = triangles[source.charts.kind[mesh.chart[triangles]] == ROOF]
    corners = mesh.vertices[mesh.triangles[roof]]
    flat = shapely.polygons(corners[..., :2])
    flat = flat[shapely.area(flat) > 1e-6]
    if not len(flat):
        return None
    covered = shapely.union_all(shapely.buffer(flat, 0.01, join_style="mitre"))
    parts = shapely.get_parts(shapely.simplify(covered, TOLERANCE_M))
    parts = [p for p in parts if p.geom_type == "Polygon" and p.area > TOLERANCE_M**2]
    if len(parts) != 1:
        return None
    holes = [ring for ring in parts[0].interiors if Polygon(ring).area > (4 * TOLERANCE_M) ** 2]
    outline = shapely.orient_polygons(Polygon(parts[0].exterior, holes))
    heights = corners[..., 2].mean(axis=1)
    order = np.argsort(heights)
    area = np.cumsum(shown_area(mesh)[roof][order])
    top = float(heights[order][np.searchsorted(area, ROOF_SHARE * area[-1])])
    base = float(mesh.vertices[mesh.triangles[triangles], 2].min())
    apart = max(float(np.abs(corners[..., 2] - top).max()), TOLERANCE_M)
    if apart > OFF_M or top - base < TOLERANCE_M or not outline.is_valid:
        return None
    return outline, base, top, apart


def _extrude(pieces: Pieces, building: int, outline: Polygon, base: float, top: float) -> None:
    for ring in (outline.exterior, *outline.interiors):
        corners = np.asarray(ring.coords)
        for a, b in zip(corners[:-1], corners[1:], strict=True):
            length = float(np.hypot(*(b - a)))
            along = np.append((b - a) / length, 0.0)
            add_planar(pieces, WALL, building, np.array([*a, top]), along, _DOWN, shapely.box(0, 0, length, top - base))
            pieces.surfaces += 1
    add_level(pieces, ROOF, building, outline, top, np.inf, np.inf)


def _nothing() -> tuple[Charts, Mesh]:
    none, index = np.zeros((0, 3)), np.zeros(0, np.int32)
    charts = Charts(index.astype(np.uint8), index, index, none, none, none, np.zeros((0, 2)))
    return charts, Mesh(none, np.zeros((0, 3), np.int32), index, index)
