"""Relief of textured meshes: openings set back in their walls, balconies before them, both with the wall's own texels."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
import shapely
from shapely import Polygon

from facade_core.core.arrays import Float64Array, Int64Array, IntArray, UInt8Array
from facade_core.core.types import Element
from facade_core.export.bodies.alignment import align_with_picture
from facade_core.export.bodies.balconies import balcony_faces
from facade_core.export.bodies.element_relief import place_elements
from facade_core.export.bodies.ledges import ledge_faces, place_ledges
from facade_core.export.bodies.openings import chart_outlines
from facade_core.export.bodies.railings import is_seen_through, railing_quads
from facade_core.export.bodies.recess import WallSpace
from facade_core.export.bodies.settings import LEDGES, MAX_OUTWARD_M
from facade_core.export.models.textured_mesh import TexturedMesh, VertexFrames
from facade_core.geometry.charts import Charts, Mesh

# Less likely elements stay flat, unless pictures measure their depth: a false balcony would be a box before the wall.
MIN_PROBABILITY = 0.5
# Corners of a box (least x and y, greatest x and y), counter-clockwise as seen from outside: columns of x and y.
BOX_CORNERS = [[0, 3], [2, 3], [2, 1], [0, 1]]
# Directions away from a box, in the chart's frame, at the edges from each of these corners to the next.
AWAY = np.array([[0.0, 1], [1, 0], [0, -1], [-1, 0]])
# A reveal shows this much of the wall next to its opening, as share of its depth.
REVEAL_SHARE = 0.2
# Quadrilaterals of the U-shaped rim of a railing, as indices of its corners.
RIM_QUADS = [[0, 1, 6, 7], [1, 2, 5, 6], [2, 3, 4, 5]]
QUAD_TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])


class ReliefFaces(NamedTuple):
    """Planar faces of walls in relief.

    Attributes
    ----------
    position : (v, 3) corners, world metres.
    place : (v, 2) places that they show, metres in the chart's frame.
    triangles : (t, 3) corner indices, counter-clockwise as seen from outside.
    face : (v,) face of each corner, ascending from 0.
    """

    position: Float64Array
    place: Float64Array
    triangles: Int64Array
    face: Int64Array


def build_wall_relief(
    charts: Charts,
    chart: int,
    position: Float64Array,
    triangles: IntArray,
    elements: Sequence[Element],
    behind: list[Float64Array],
    is_open: Callable[[Polygon], bool],
) -> ReliefFaces | None:
    """Build a wall with its elements in depth; None if it stays flat.

    The outline of the wall keeps its vertices. Elements that are unlikely, that the border or another element cuts, or that
    have no room, stay flat.

    Parameters
    ----------
    charts : charts of the mesh.
    chart : chart of the wall.
    position : (v, 3) vertices of the wall, world metres.
    triangles : (t, 3) vertex indices of the wall's triangles.
    elements : elements of the wall, metres, y down.
    behind : triangles (t, 3, 3) of surfaces that no element may meet.
    is_open : returns whether the railing of a balcony's rectangle is seen through.

    Returns
    -------
    The flat part of the wall and the faces of its elements.
    """
    place = charts.coordinates(np.full(len(position), chart), position)
    known = dict(zip(map(tuple, place[triangles].reshape(-1, 2).tolist()), triangles.reshape(-1).tolist(), strict=True))
    faces: list[ReliefFaces] = []
    has_elements = False
    for outline in chart_outlines(place[triangles]):
        flat = shapely.get_coordinates(outline)
        corners = position[[known[x, y] for x, y in flat.tolist()]]
        space = WallSpace(charts, chart, corners, behind)
        holes, found = _build_elements(space, outline, elements, is_open)
        wall = _triangulate_wall(outline, np.concatenate([corners, space.points(holes.reshape(-1, 2))]), holes)
        if wall is None:
            return None
        faces += [wall, *found]
        has_elements |= bool(found)
    return _join_faces(faces) if has_elements else None


def _build_elements(
    space: WallSpace, outline: Polygon, elements: Sequence[Element], is_open: Callable[[Polygon], bool]
) -> tuple[Float64Array, list[ReliefFaces]]:
    """Build the elements of a wall polygon; returns the holes (n, 4, 2) that they need, and their faces."""
    likely = [e for e in elements if e.confidence >= MIN_PROBABILITY or e.depth_source == "parallax"]
    placed = [element for element in place_elements(outline, likely) if element.depth.outward_m and not element.is_cut]
    boxes = np.array([element.outline.bounds for element in placed]).reshape(-1, 4)
    outward = np.array([element.depth.outward_m for element in placed])
    is_opening = outward < 0
    openings, depth = boxes[is_opening], space.recess_depths(boxes[is_opening], -outward[is_opening])
    holes, depth = openings[depth > 0][:, BOX_CORNERS], depth[depth > 0]
    faces = [_build_recesses(space, holes, depth)] if len(holes) else []
    has_room = space.has_room(boxes[~is_opening], outward[~is_opening])
    bodies = [element for element, opening in zip(placed, is_opening.tolist(), strict=True) if not opening]
    for element, is_free in zip(bodies, has_room.tolist(), strict=True):
        if is_free:
            build = _build_railing if is_open(element.outline) else _build_balcony
            faces.append(build(space, element.outline, element.depth.outward_m))
    ledges = place_ledges(outline, elements)
    edges = np.array([box.bounds for box in ledges]).reshape(-1, 4)
    has_room = space.has_room(edges, np.full(len(edges), LEDGES.ledge_depth_m))
    for box, is_free in zip(ledges, has_room.tolist(), strict=True):
        if is_free:
            faces.append(_build_ledge(space, box))
    return holes, faces


def _build_recesses(space: WallSpace, holes: Float64Array, depth: Float64Array) -> ReliefFaces:
    """Build panes and reveals of openings.

    Parameters
    ----------
    holes : (n, 4, 2) corners in the chart's frame.
    depth : (n,) depth of each opening, metres.
    """
    following = np.roll(holes, -1, axis=1)
    beside = np.stack([holes, following, following, holes], axis=2)
    corners = np.concatenate([holes[:, None], beside], axis=1)
    inward = np.zeros((len(holes), 5, 4))
    inward[:, 0] = depth[:, None]
    inward[:, 1:, 2:] = depth[:, None, None]
    # reveals show what the picture has at the cut: wall in shade, where it blends into the opening
    shown = corners.copy()
    shown[:, 1:, 2:] += (REVEAL_SHARE * AWAY * depth[:, None, None])[:, :, None]
    return _quad_faces(space, corners.reshape(-1, 4, 2), -inward.reshape(-1, 4), shown.reshape(-1, 4, 2))


def _build_railing(space: WallSpace, box: Polygon, far: float) -> ReliefFaces:
    """Build a balcony whose railing is seen through."""
    quads, places = railing_quads(box, far)
    return _quad_faces(space, quads[..., :2], quads[..., 2], places)


def _build_balcony(space: WallSpace, box: Polygon, far: float) -> ReliefFaces:
    """Build a balcony; without the face against the wall, where two coplanar faces would flicker."""
    *sides, (rim_ring, rim_place) = [(ring, place) for (ring,), (place,), _ in balcony_faces(box, far)[:-1]]
    rings = np.array([*(ring for ring, _ in sides), *rim_ring[RIM_QUADS]], float)
    places = np.array([*(place for _, place in sides), *rim_place[RIM_QUADS]])
    return _quad_faces(space, rings[..., :2], rings[..., 2], places)


def _build_ledge(space: WallSpace, box: Polygon) -> ReliefFaces:
    """Build a ledge, without the face against the wall."""
    sides = ledge_faces(box)[:-1]
    rings = np.array([ring for (ring,), _, _ in sides], float)
    return _quad_faces(space, rings[..., :2], rings[..., 2], np.array([place for _, (place,), _ in sides]))


def _quad_faces(space: WallSpace, flat: Float64Array, outward: Float64Array, places: Float64Array) -> ReliefFaces:
    """Build quadrilaterals (q, 4) at places of the chart's frame and metres before the wall, which show other places."""
    count = len(flat)
    return ReliefFaces(
        space.points(flat.reshape(-1, 2)) + outward.reshape(-1, 1) * space.out,
        places.reshape(-1, 2),
        (4 * np.arange(count)[:, None, None] + QUAD_TRIANGLES).reshape(-1, 3),
        np.repeat(np.arange(count), 4),
    )


def _triangulate_wall(outline: Polygon, position: Float64Array, holes: Float64Array) -> ReliefFaces | None:
    """Triangulate a wall polygon with holes (n, 4, 2) more; None if it crosses itself.

    Parameters
    ----------
    position : (v, 3) corners of the outline's closed rings, then of the holes, world metres.
    """
    place = np.concatenate([shapely.get_coordinates(outline), holes.reshape(-1, 2)])
    polygon = Polygon(outline.exterior, [*outline.interiors, *holes])
    if not polygon.is_valid:
        return None
    parts = shapely.orient_polygons(
        shapely.get_parts(shapely.constrained_delaunay_triangles(polygon)), exterior_cw=True
    )
    corners = shapely.get_coordinates(parts).reshape(-1, 4, 2)[:, :3].reshape(-1, 2)
    _, first, index = np.unique(np.concatenate([place, corners]), axis=0, return_index=True, return_inverse=True)
    used, triangles = np.unique(first[index.reshape(-1)[len(place) :]], return_inverse=True)
    return ReliefFaces(position[used], place[used], triangles.reshape(-1, 3), np.zeros(len(used), np.int64))


def _join_faces(parts: Sequence[ReliefFaces]) -> ReliefFaces:
    """Join faces; corners and faces are numbered consecutively."""
    first = np.cumsum([0, *(len(part.position) for part in parts[:-1])]).tolist()
    faces = np.cumsum([0, *(int(part.face[-1]) + 1 for part in parts[:-1])]).tolist()
    return ReliefFaces(
        np.concatenate([part.position for part in parts]),
        np.concatenate([part.place for part in parts]),
        np.concatenate([part.triangles + start for part, start in zip(parts, first, strict=True)]),
        np.concatenate([part.face + start for part, start in zip(parts, faces, strict=True)]),
    )


def add_relief(
    source: TexturedMesh,
    layouts: Mapping[int, Sequence[Element]],
    raster: Callable[[int], UInt8Array] | None = None,
) -> TexturedMesh:
    """Return a mesh with the elements of its walls in depth.

    Parameters
    ----------
    source : the flat mesh.
    layouts : elements of a chart in metres, y down.
    raster : returns the picture of a chart with which its elements are aligned; that of the mesh by default.
    """
    mesh, charts = source.mesh, source.charts
    raster = raster or source.raster
    walls: dict[int, ReliefFaces] = {}
    for chart in sorted(layouts, key=lambda chart: (charts.building[chart], chart)):
        if charts.building[chart] < 0:
            continue
        used, triangles = np.unique(mesh.triangles[mesh.chart_triangles(chart)], return_inverse=True)
        picture, texels_per_metre = raster(chart), source.texels[chart] / source.extent[chart]
        layout = align_with_picture(picture, texels_per_metre, layouts[chart])
        near = [other for other in charts.charts_within(chart, MAX_OUTWARD_M).tolist() if charts.building[other] >= 0]
        surfaces = [mesh.vertices[mesh.triangles[mesh.chart_triangles(other)]] for other in near]
        own = [walls[n] for n in near if n in walls and charts.building[n] == charts.building[chart]]
        found = build_wall_relief(
            charts,
            chart,
            mesh.vertices[used],
            triangles.reshape(-1, 3),
            layout,
            [*surfaces, *(wall.position[wall.triangles] for wall in own)],
            partial(is_seen_through, picture, texels_per_metre),
        )
        if found is not None:
            walls[chart] = found
    return _replace_walls(source, walls) if walls else source


def _replace_walls(source: TexturedMesh, walls: Mapping[int, ReliefFaces]) -> TexturedMesh:
    """Replace the triangles of charts by faces."""
    mesh = source.mesh
    chart, found = np.array(list(walls), np.int32), list(walls.values())
    keep, faces = ~np.isin(mesh.chart, chart), _join_faces(found)
    relief = Mesh(
        np.concatenate([mesh.vertices, faces.position]),
        np.concatenate([mesh.triangles[keep], (faces.triangles + len(mesh.vertices)).astype(np.int32)]),
        np.concatenate([mesh.chart[keep], np.repeat(chart, [len(wall.triangles) for wall in found])]),
        np.concatenate([mesh.vertex_chart, np.repeat(chart, [len(wall.position) for wall in found])]),
    )
    normals, tangents = _face_frames(faces)
    frames = VertexFrames(
        np.concatenate([source.normals, normals[faces.face]]),
        np.concatenate([source.coordinates, faces.place]),
        np.concatenate([source.tangents, tangents[faces.face]]),
    )
    return replace(source, mesh=relief, frames=frames)


def _face_frames(faces: ReliefFaces) -> tuple[Float64Array, Float64Array]:
    """Return the unit normals (f, 3) of faces and their tangents (f, 4): direction of the texture to the right, handedness."""
    count = np.bincount(faces.face)[:, None]

    def sums(values: Float64Array, face: Int64Array = faces.face) -> Float64Array:
        return np.stack([np.bincount(face, column, len(count)) for column in values.T], axis=1)

    a, b, c = np.moveaxis(faces.position[faces.triangles], 1, 0)
    normal = _unit(sums(np.cross(b - a, c - a), faces.face[faces.triangles[:, 0]]))
    offset = faces.position - (sums(faces.position) / count)[faces.face]
    shown = faces.place - (sums(faces.place) / count)[faces.face]
    # least squares of the positions by the places, by their normal equations
    (xx, xy, yy), by_x, by_y = (
        sums(np.column_stack([shown[:, 0] ** 2, shown[:, 0] * shown[:, 1], shown[:, 1] ** 2])).T[..., None],
        sums(shown[:, :1] * offset),
        sums(shown[:, 1:] * offset),
    )
    determinant, trace = xx * yy - xy**2, xx + yy
    is_line = determinant <= 1e-12 * trace**2  # the face shows one line: the solution of least norm
    divisor = np.where(is_line, trace**2, determinant)
    right = np.where(is_line, xx * by_x + xy * by_y, yy * by_x - xy * by_y) / divisor
    down = np.where(is_line, xy * by_x + yy * by_y, xx * by_y - xy * by_x) / divisor
    right -= normal * (right * normal).sum(axis=1, keepdims=True)
    is_column = np.linalg.norm(right, axis=1, keepdims=True) < 1e-6
    right = _unit(np.where(is_column, np.cross(down, normal), right))
    is_mirrored = (np.cross(normal, right) * down).sum(axis=1) > 0
    return normal, np.column_stack([right, np.where(is_mirrored, -1.0, 1.0)])


def _unit(vectors: Float64Array) -> Float64Array:
    units: Float64Array = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return units
