"""Buildings of a block as CityJSON's faces: a chart is a surface, a facade's windows and doors are surfaces of their own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import shapely
from shapely import Polygon

from facade_core.export.cityjson import Face
from facade_core.export.footprints import GRID_M, footprint
from facade_core.export.models import Drawn
from facade_core.export.openings import cut_openings, outlines
from facade_core.geometry.charts import CEILING, KINDS, ROOF, WINDOW
from facade_core.types import Element

SEMANTICS = {
    "wall": "WallSurface",
    "roof": "RoofSurface",
    "ground": "GroundSurface",
    "window": "Window",
    "door": "Door",
    "ceiling": "OuterCeilingSurface",
}
OPENINGS = {"window": "Window", "door": "Door"}


def building_faces(
    drawn: Drawn,
    triangles: np.ndarray,
    facades: Mapping[int, str],
    layouts: Mapping[int, Sequence[Element]],
    *,
    assumed: bool = False,
) -> tuple[list[Face], list[dict[str, Any]]]:
    """The faces of one building, and the semantic surfaces that they count.

    triangles: the building's, of the mesh that is drawn. facades: chart -> id of the facade there; layouts: chart -> its
    elements in metres, y down, of which windows and doors are cut out. The ground below, the last faces, has no texture.
    assumed: the roof is, so that the panes in it are drawn and no openings that anybody knows of: they count as roof.
    """
    source, mesh = drawn.source, drawn.source.mesh
    faces: list[Face] = []
    surfaces: list[dict[str, Any]] = []
    shared: dict[str, int] = {}

    def surface(kind: str, **more: Any) -> int:
        surfaces.append({"type": kind, **more})
        return len(surfaces) - 1

    chart_of = mesh.chart[triangles]
    for chart in np.unique(chart_of).tolist():
        own = mesh.triangles[triangles[chart_of == chart]]
        parts = outlines(source.coordinates[own])
        corners = np.unique(own)
        known = dict(zip(map(tuple, source.coordinates[corners].tolist()), corners.tolist(), strict=True))
        own_kind = int(source.charts.kind[chart])
        kind = SEMANTICS[KINDS[ROOF if assumed and own_kind == WINDOW else own_kind]]
        if chart in facades:
            semantic = surface(kind, facade=facades[chart])
        else:
            semantic = shared[kind] if kind in shared else shared.setdefault(kind, surface(kind))
        for part in parts:
            walls, openings = cut_openings(part, layouts[chart]) if chart in layouts else ([part], [])
            faces += [_face(drawn, chart, wall, semantic, known) for wall in walls]
            for element, opening in openings:
                faces.append(_face(drawn, chart, opening, surface(OPENINGS[element.label], parent=semantic), known))
    below = _ground(drawn, triangles)
    if below:
        semantic = surface("GroundSurface")
        faces += [Face(rings, semantic) for rings in below]
    return faces, surfaces


def _face(drawn: Drawn, chart: int, polygon: Polygon, semantic: int, known: Mapping[tuple[float, ...], int]) -> Face:
    """A polygon in a chart's frame: corners that the mesh has stay where they are, others are put on the chart's plane."""
    charts, vertices = drawn.source.charts, drawn.source.mesh.vertices
    rings, places = [], []
    for ring in (polygon.exterior, *polygon.interiors):
        flat = np.asarray(ring.coords)[:-1]
        points = charts.points(chart, *flat.T)
        for i, corner in enumerate(map(tuple, flat.tolist())):
            if corner in known:
                points[i] = vertices[known[corner]]
        uv = drawn.texture_coordinates(np.full(len(flat), chart), flat)
        rings.append(points)
        places.append(np.column_stack([uv[:, 0], 1 - uv[:, 1]]))
    page = int(drawn.layout.page[np.searchsorted(drawn.charts, chart)])
    return Face(tuple(rings), semantic, tuple(places), page)


def _ground(drawn: Drawn, triangles: np.ndarray) -> list[tuple[np.ndarray, ...]]:
    """What a building's roofs cover, at its lowest point, facing down: meshes end at the ground and have no surface there.
    Nothing where a ceiling is lowest: it begins above the ground."""
    mesh = drawn.source.mesh
    height = mesh.vertices[mesh.triangles[triangles], 2]
    base = height.min()
    ceiling = drawn.source.charts.kind[mesh.chart[triangles]] == CEILING
    if (height[ceiling] < base + GRID_M).all(axis=1).any():
        return []
    # clockwise from above is counter-clockwise from below
    parts = [shapely.orient_polygons(part, exterior_cw=True) for part in footprint(drawn.source, triangles)]
    return [
        tuple(
            np.column_stack([np.asarray(ring.coords)[:-1], np.full(len(ring.coords) - 1, base)])
            for ring in (part.exterior, *part.interiors)
        )
        for part in parts
    ]


def ground_faces(drawn: Drawn, triangles: np.ndarray) -> list[Face]:
    """The triangles of the terrain, textured."""
    source, mesh = drawn.source, drawn.source.mesh
    chart = mesh.chart[triangles]
    corners = mesh.triangles[triangles]
    uv = drawn.texture_coordinates(mesh.vertex_chart[corners.reshape(-1)], source.coordinates[corners.reshape(-1)])
    uv[:, 1] = 1 - uv[:, 1]
    page = drawn.layout.page[np.searchsorted(drawn.charts, chart)].tolist()
    return [
        Face((points,), 0, (place,), shown)
        for points, place, shown in zip(mesh.vertices[corners], uv.reshape(-1, 3, 2), page, strict=True)
    ]
