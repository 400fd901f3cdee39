"""Relief of textured meshes: openings set back in their walls, balconies before them, both with the wall's own texels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from shapely import Polygon

from facade_core.core.arrays import Float64Array, Int64Array, IntArray
from facade_core.core.grouping import group_rows
from facade_core.core.types import Element
from facade_core.export.bodies.balconies import balcony_faces
from facade_core.export.bodies.element_relief import place_elements
from facade_core.export.bodies.openings import chart_outlines
from facade_core.export.bodies.patches import MeshPolygon, triangulate_mesh_polygon
from facade_core.export.bodies.recess import has_room, project_on_wall, recess_opening
from facade_core.export.bodies.settings import MAX_OUTWARD_M
from facade_core.export.models.textured_mesh import TexturedMesh, VertexFrames
from facade_core.geometry.charts import Charts, Mesh


class ReliefFace(NamedTuple):
    """Planar face of a wall in relief.

    Attributes
    ----------
    position : (v, 3) corners, world metres.
    place : (v, 2) places that they show, metres in the chart's frame.
    triangles : (t, 3) corner indices, counter-clockwise as seen from outside.
    """

    position: Float64Array
    place: Float64Array
    triangles: Int64Array


def build_wall_relief(
    charts: Charts,
    chart: int,
    position: Float64Array,
    triangles: IntArray,
    elements: Sequence[Element],
    behind: list[Float64Array],
) -> list[ReliefFace] | None:
    """Build a wall with its elements in depth; None if it stays flat.

    The outline of the wall keeps its vertices. Elements that the border or another element cuts, or that have no room, stay
    flat.

    Parameters
    ----------
    charts : charts of the mesh.
    chart : chart of the wall.
    position : (v, 3) vertices of the wall, world metres.
    triangles : (t, 3) vertex indices of the wall's triangles.
    elements : elements of the wall, metres, y down.
    behind : triangles (t, 3, 3) of surfaces that no element may meet.

    Returns
    -------
    The flat part of the wall and the faces of its elements.
    """
    place = charts.coordinates(np.full(len(position), chart), position)
    known = dict(zip(map(tuple, place[triangles].reshape(-1, 2).tolist()), triangles.reshape(-1).tolist(), strict=True))
    faces: list[ReliefFace] = []
    has_elements = False
    for outline in chart_outlines(place[triangles]):
        rings = [np.asarray(ring.coords)[:-1] for ring in (outline.exterior, *outline.interiors)]
        corners = [position[[known[x, y] for x, y in ring.tolist()]] for ring in rings]
        holes, found = _build_elements(charts, chart, outline, np.concatenate(corners), elements, behind)
        flat = [*rings, *(places[::-1] for _, places in holes)]
        wall = _triangulate_face([*corners, *(points[::-1] for points, _ in holes)], flat)
        if wall is None:
            return None
        faces += [wall, *found]
        has_elements |= bool(found)
    return faces if has_elements else None


def _build_elements(
    charts: Charts,
    chart: int,
    outline: Polygon,
    corners: Float64Array,
    elements: Sequence[Element],
    behind: list[Float64Array],
) -> tuple[list[tuple[Float64Array, Float64Array]], list[ReliefFace]]:
    """Build the elements of a wall polygon; returns the holes (positions, places) that they need, and their faces."""
    holes: list[tuple[Float64Array, Float64Array]] = []
    faces: list[ReliefFace | None] = []
    out = charts.normals()[chart]
    for element in place_elements(outline, elements):
        outward = element.depth.outward_m
        if element.is_cut or not outward:
            continue
        if outward < 0:
            opening = recess_opening(element.outline, -outward, charts, chart, corners, behind)
            if opening.depth:
                holes.append((opening.ring, opening.chart_ring))
                faces.append(_triangulate_face([opening.pane_ring], [opening.chart_ring]))
                faces += [_triangulate_face([ring], [flat]) for ring, flat in opening.reveals()]
        elif has_room(element.outline, outward, charts, chart, corners[0], behind):
            # the last face is against the wall, where two coplanar faces would flicker
            for (ring,), (flat,), _ in balcony_faces(element.outline, outward)[:-1]:
                points = project_on_wall(charts, chart, corners, ring[:, :2]) + ring[:, 2:] * out
                faces.append(_triangulate_face([points], [flat]))
    return holes, [face for face in faces if face is not None]


def _triangulate_face(rings: Sequence[Float64Array], places: Sequence[Float64Array]) -> ReliefFace | None:
    """Triangulate a polygon of rings (k, 3) that show places (k, 2); None if it crosses itself."""
    if len(rings) == 1 and len(rings[0]) == 4:  # rectangles, most of all faces
        return ReliefFace(rings[0], places[0], np.array([[0, 1, 2], [0, 2, 3]]))
    points = np.concatenate(rings)
    ends = np.cumsum([len(ring) for ring in rings]).tolist()
    patch = MeshPolygon(
        tuple(tuple(range(end - len(ring), end)) for ring, end in zip(rings, ends, strict=True)),
    )
    triangles = triangulate_mesh_polygon(patch, points)
    return ReliefFace(points, np.concatenate(places), triangles) if len(triangles) else None


def add_relief(source: TexturedMesh, layouts: Mapping[int, Sequence[Element]]) -> TexturedMesh:
    """Return a mesh with the elements of its walls in depth.

    Parameters
    ----------
    source : the flat mesh.
    layouts : elements of a chart in metres, y down.
    """
    mesh, charts = source.mesh, source.charts
    faces: list[ReliefFace] = []
    owners: list[int] = []
    of_building = group_rows(charts.building[mesh.chart])
    for building in sorted({int(charts.building[chart]) for chart in layouts} & of_building.keys()):
        behind = [mesh.vertices[mesh.triangles[of_building[building]]]]
        for chart in sorted(chart for chart in layouts if charts.building[chart] == building):
            used, triangles = np.unique(mesh.triangles[mesh.chart_triangles(chart)], return_inverse=True)
            others = [*behind, *_neighbour_triangles(source, chart)]
            found = build_wall_relief(
                charts, chart, mesh.vertices[used], triangles.reshape(-1, 3), layouts[chart], others
            )
            if found is None:
                continue
            behind.append(np.concatenate([face.position[face.triangles] for face in found]))
            faces += found
            owners += [chart] * len(found)
    return _replace_walls(source, faces, np.array(owners, np.int32)) if faces else source


def _neighbour_triangles(source: TexturedMesh, chart: int) -> list[Float64Array]:
    """Return the triangles (t, 3, 3) of other buildings' charts that an element of a chart could meet."""
    mesh, charts = source.mesh, source.charts
    return [
        mesh.vertices[mesh.triangles[mesh.chart_triangles(other)]]
        for other in charts.charts_within(chart, MAX_OUTWARD_M).tolist()
        if charts.building[other] not in (-1, charts.building[chart])
    ]


def _replace_walls(source: TexturedMesh, faces: Sequence[ReliefFace], chart: IntArray) -> TexturedMesh:
    """Replace the triangles of charts by faces, whose charts (f,) are given."""
    mesh = source.mesh
    keep = ~np.isin(mesh.chart, chart)
    corners, count = [len(face.position) for face in faces], [len(face.triangles) for face in faces]
    first = len(mesh.vertices) + np.cumsum([0, *corners[:-1]])
    triangles = np.concatenate([face.triangles + start for face, start in zip(faces, first, strict=True)])
    normals, tangents = zip(*map(_face_frame, faces), strict=True)
    relief = Mesh(
        np.concatenate([mesh.vertices, *(face.position for face in faces)]),
        np.concatenate([mesh.triangles[keep], triangles.astype(np.int32)]),
        np.concatenate([mesh.chart[keep], np.repeat(chart, count)]),
        np.concatenate([mesh.vertex_chart, np.repeat(chart, corners)]),
    )
    frames = VertexFrames(
        np.concatenate([source.normals, np.repeat(normals, corners, axis=0)]),
        np.concatenate([source.coordinates, *(face.place for face in faces)]),
        np.concatenate([source.tangents, np.repeat(tangents, corners, axis=0)]),
    )
    return replace(source, mesh=relief, frames=frames)


def _face_frame(face: ReliefFace) -> tuple[Float64Array, Float64Array]:
    """Return the unit normal (3,) of a face and its tangent (4,): direction of the texture to the right, and handedness."""
    a, b, c = np.moveaxis(face.position[face.triangles], 1, 0)
    normal = np.cross(b - a, c - a).sum(axis=0)
    normal /= np.linalg.norm(normal)
    offset, shown = face.position - face.position.mean(axis=0), face.place - face.place.mean(axis=0)
    right, down = np.linalg.lstsq(shown, offset, rcond=None)[0]
    right -= normal * (right @ normal)
    if np.linalg.norm(right) < 1e-6:  # the face shows one column
        right = np.cross(down, normal)
    right /= np.linalg.norm(right)
    return normal, np.append(right, 1.0 if np.cross(normal, right) @ down <= 0 else -1.0)
