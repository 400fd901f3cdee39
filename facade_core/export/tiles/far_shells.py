"""Simplified shells of buildings for distant views: outlines extruded to one height with baked textures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely import Polygon

from facade_core.core.arrays import Int64Array, IntArray, UInt8Array
from facade_core.core.grouping import group_rows
from facade_core.export.bodies.footprints import building_footprint
from facade_core.export.models.pages import PbrMaps, downscale
from facade_core.export.models.textured_mesh import TexturedMesh, triangle_areas
from facade_core.export.tiles.baking import ShellRasters, bake_rasters
from facade_core.export.tiles.settings import FAR_SHELLS
from facade_core.geometry.charts import ChartBuilder, ChartKind, Charts, Mesh, SurfaceTarget
from facade_core.geometry.ground.ground_charts import add_horizontal_surface, add_planar_chart

# Encoded normal that points outward.
FLAT_NORMAL = (128, 128, 255)
# Encoded occlusion, roughness and metalness of a distant wall.
DEFAULT_ORM = (255, 217, 0)

_DOWN = np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True)
class BuildingShells:
    """Shells of a block's buildings.

    Attributes
    ----------
    textured_mesh : shells with their rasters.
    without_shell : (k,) buildings that keep their own surfaces.
    deviation_m : distance of a building's roofs from its shell, metres.
    """

    textured_mesh: TexturedMesh
    without_shell: Int64Array
    deviation_m: Mapping[int, float]


def build_shells(
    source: TexturedMesh, density: float, on_progress: Callable[[], None] = lambda: None
) -> BuildingShells:
    """Build a shell for every building.

    Parameters
    ----------
    source : textured mesh of the block.
    density : texels per metre of the shells.
    on_progress : called after each building.
    """
    pieces, kept = ChartBuilder(), []
    off: dict[int, float] = {}
    triangles = group_rows(source.charts.building[source.mesh.chart])
    for building, mine in triangles.items():
        if building < 0:
            continue
        body = _shell_outlines(source, mine)
        if body is None:
            kept.append(building)
            on_progress()
            continue
        outlines, base, top, off[building] = body
        for outline in outlines:
            _extrude(pieces, building, outline, base, top)
    charts, mesh = pieces.build() if len(pieces) else _empty_mesh()
    texels = charts.texels(density)
    maps = source.maps
    looks = _baked_layers(source)
    rasters: list[dict[int, UInt8Array]] = [{} for _ in looks]
    for building, mine in group_rows(charts.building).items():
        layers = bake_rasters(source, triangles[building], ShellRasters(charts, texels, density), mine, looks)
        for own, baked in zip(rasters, layers, strict=True):
            own |= baked
        on_progress()
    shown = TexturedMesh(charts, mesh, texels / density, texels, rasters[0].__getitem__)
    if maps is not None:
        shown = replace(shown, maps=lambda chart: _flat_maps(rasters[1][chart]))
    return BuildingShells(shown, np.array(kept, np.int64), off)


def _baked_layers(source: TexturedMesh) -> list[Callable[[int], UInt8Array]]:
    """Return the layers of a source that shells show: its colour, and its light at night if it is relit."""
    maps = source.maps
    return [source.raster] if maps is None else [source.raster, lambda chart: _emissive_raster(maps(chart))]


def _emissive_raster(maps: PbrMaps) -> UInt8Array:
    return np.zeros_like(maps.normal) if maps.emissive is None else maps.emissive


def _flat_maps(emissive: UInt8Array) -> PbrMaps:
    """Return maps without relief; emissive (h, w, 3) is at the texels of the colour."""
    height, width = emissive.shape[:2]
    small = downscale(emissive, (-(-width // 2), -(-height // 2)))
    flat, matt = (np.broadcast_to(np.array(one, np.uint8), small.shape) for one in (FLAT_NORMAL, DEFAULT_ORM))
    return PbrMaps(flat, matt, small if small.any() else None)


def _shell_outlines(source: TexturedMesh, triangles: IntArray) -> tuple[list[Polygon], float, float, float] | None:
    """Return outlines, base and top of a shell and its deviation from the roofs; None if that is too large."""
    mesh = source.mesh
    roof = triangles[source.charts.kind[mesh.chart[triangles]] == ChartKind.ROOF]
    if not len(roof):
        return None
    corners = mesh.vertices[mesh.triangles[roof]]
    covered = shapely.union_all(
        shapely.buffer(building_footprint(source, triangles), FAR_SHELLS.gap_closing_m, join_style="mitre")
    )
    outlines = [
        shapely.orient_polygons(_without_small_courtyards(part))
        for part in shapely.get_parts(shapely.simplify(covered, FAR_SHELLS.outline_tolerance_m))
        if part.area > FAR_SHELLS.outline_tolerance_m**2
    ]
    heights = corners[..., 2].mean(axis=1)
    order = np.argsort(heights)
    areas = triangle_areas(mesh)[roof]
    area = np.cumsum(areas[order])
    top = float(heights[order][np.searchsorted(area, FAR_SHELLS.roof_share * area[-1])])
    base = float(mesh.vertices[mesh.triangles[triangles], 2].min())
    off = np.abs(corners[..., 2] - top).max(axis=1)
    apart = max(float(off[areas > FAR_SHELLS.min_roof_triangle_m2].max(initial=0.0)), FAR_SHELLS.outline_tolerance_m)
    if (
        apart > FAR_SHELLS.max_deviation_m
        or top - base < FAR_SHELLS.outline_tolerance_m
        or not outlines
        or not all(o.is_valid for o in outlines)
    ):
        return None
    return outlines, base, top, apart


def _without_small_courtyards(outline: Polygon) -> Polygon:
    return Polygon(outline.exterior, [r for r in outline.interiors if Polygon(r).area > FAR_SHELLS.min_courtyard_m2])


def _extrude(pieces: ChartBuilder, building: int, outline: Polygon, base: float, top: float) -> None:
    target = SurfaceTarget(pieces, building, np.inf, np.inf)
    for ring in (outline.exterior, *outline.interiors):
        corners = np.asarray(ring.coords)
        for a, b in zip(corners[:-1], corners[1:], strict=True):
            length = float(np.hypot(*(b - a)))
            along = np.append((b - a) / length, 0.0)
            frame = np.array([*a, top]), along, _DOWN
            add_planar_chart(target, ChartKind.WALL, frame, shapely.box(0, 0, length, top - base))
            pieces.surface_count += 1
    add_horizontal_surface(target, ChartKind.ROOF, outline, top)


def _empty_mesh() -> tuple[Charts, Mesh]:
    none, index = np.zeros((0, 3)), np.zeros(0, np.int32)
    charts = Charts(index.astype(np.uint8), index, index, none, none, none, np.zeros((0, 2)))
    return charts, Mesh(none, np.zeros((0, 3), np.int32), index, index)
