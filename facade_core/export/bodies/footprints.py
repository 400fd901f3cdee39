"""Footprints of buildings from the surfaces above them."""

from __future__ import annotations

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from facade_core.core.arrays import IntArray
from facade_core.core.grouping import group_rows
from facade_core.export.bodies.settings import FOOTPRINTS
from facade_core.export.models.textured_mesh import TexturedMesh
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.settings import FACADE_WALLS


def building_footprint(source: TexturedMesh, triangles: IntArray) -> list[Polygon]:
    """Compute the footprint of a building: the area under its roofs without eaves.

    Eaves have a ceiling below them; the area over a passage counts. If ceilings cover everything, or there is no roof, all
    surfaces count.

    Parameters
    ----------
    source : textured mesh.
    triangles : (t,) triangles of the building.
    """
    kind = source.charts.kind[source.mesh.chart[triangles]]
    roof = triangles[kind == ChartKind.ROOF]
    covered = _covered_area(source, roof if len(roof) else triangles)
    over_passage = np.isin(source.mesh.chart[triangles], _passage_ceilings(source, triangles, roof))
    open_below = _covered_area(source, triangles[(kind == ChartKind.CEILING) & ~over_passage])
    standing = (
        _polygon_parts(shapely.difference(covered, open_below, grid_size=FOOTPRINTS.snap_grid_m)) if len(roof) else []
    )
    return standing or _polygon_parts(covered)


def _passage_ceilings(source: TexturedMesh, triangles: IntArray, roof: IntArray) -> list[int]:
    """Return the charts of ceilings far below the roof between two walls that face each other."""
    charts, mesh = source.charts, source.mesh
    own = np.unique(mesh.chart[triangles])
    lowest_roof = mesh.vertices[mesh.triangles[roof], 2].min(initial=np.inf)
    low = own[
        (charts.kind[own] == ChartKind.CEILING) & (charts.origin[own, 2] < lowest_roof - FOOTPRINTS.min_below_roof_m)
    ]
    walls = own[charts.kind[own] == ChartKind.WALL]
    found = []
    for ceiling in low.tolist():
        below = walls[np.abs(charts.origin[walls, 2] - charts.origin[ceiling, 2]) < FOOTPRINTS.max_ceiling_gap_m]
        area = _covered_area(source, triangles[mesh.chart[triangles] == ceiling])
        edges = shapely.linestrings(charts.points_at_shares(below, np.array([[0.0, 0.0], [1.0, 0.0]]))[..., :2])
        below = below[shapely.distance(area, edges) < FOOTPRINTS.max_ceiling_gap_m]
        middle, normal = charts.points_at_shares(below, np.array([[0.5, 0.0]]))[:, 0], charts.normals()[below]
        ahead = np.einsum("ijk,ik->ij", middle[None] - middle[:, None], normal)
        if ((normal @ normal.T < FACADE_WALLS.max_facing_cosine) & (ahead > 0)).any():
            found.append(ceiling)
    return found


def _covered_area(source: TexturedMesh, triangles: IntArray) -> shapely.Geometry:
    flat = shapely.polygons(source.mesh.vertices[source.mesh.triangles[triangles]][..., :2])
    return shapely.union_all(flat[shapely.area(flat) > FOOTPRINTS.snap_grid_m**2], grid_size=FOOTPRINTS.snap_grid_m)


def _polygon_parts(covered: shapely.Geometry) -> list[Polygon]:
    parts = shapely.get_parts(covered)
    return [part for part in parts if part.geom_type == "Polygon" and part.area >= FOOTPRINTS.min_part_m2]


def building_footprints(source: TexturedMesh) -> dict[int, MultiPolygon]:
    """Compute the footprint of every building that has one."""
    parts = {
        building: building_footprint(source, triangles)
        for building, triangles in group_rows(source.charts.building[source.mesh.chart]).items()
        if building >= 0
    }
    return {building: MultiPolygon(polygons) for building, polygons in parts.items() if polygons}
