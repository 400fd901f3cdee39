"""Polygons with shared corners: welding, T-junctions, planarity, open edges and connected components."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from facade_core.core.arrays import Float64Array, Int32Array, Int64Array
from facade_core.core.grouping import group_rows
from facade_core.export.bodies.settings import BODIES


@dataclass(frozen=True)
class MeshPolygon:
    """Polygon of a mesh.

    Attributes
    ----------
    rings : corner indices, exterior first, counter-clockwise as seen from outside.
    chart : chart whose texture it shows, -1 without.
    semantic : index of its semantic surface, -1 without.
    """

    rings: tuple[tuple[int, ...], ...]
    chart: int = -1
    semantic: int = -1

    def edges(self) -> Iterator[tuple[int, int]]:
        """Iterate over the directed edges."""
        for ring in self.rings:
            yield from zip(ring, ring[1:] + ring[:1], strict=True)

    def ring_points(self, points: Float64Array) -> list[Float64Array]:
        """Return the corners (k, 3) of each ring from those of the mesh (n, 3)."""
        return [points[list(ring)] for ring in self.rings]


@dataclass(frozen=True)
class PolygonMesh:
    """Polygons of one object over shared corners.

    Attributes
    ----------
    points : (n, 3) corners, world metres.
    patches : the polygons.
    """

    points: Float64Array
    patches: tuple[MeshPolygon, ...]

    def subset(self, chosen: Sequence[int]) -> PolygonMesh:
        """Return the mesh with the chosen patches."""
        return PolygonMesh(self.points, tuple(self.patches[i] for i in chosen))

    def area_vector(self, patch: MeshPolygon) -> Float64Array:
        """Return the area of a patch as an outward vector (3,), m2."""
        return polygon_area_vector(patch, self.points)


def ring_area_vector(points: Float64Array) -> Float64Array:
    """Return the area of a ring (k, 3) as a vector (3,)."""
    offset = points - points[0]
    area_vector: Float64Array = np.cross(offset[1:-1], offset[2:]).sum(axis=0) / 2
    return area_vector


def polygon_area_vector(patch: MeshPolygon, points: Float64Array) -> Float64Array:
    """Return the area of a polygon over corners (n, 3) as an outward vector (3,), m2."""
    return sum(map(ring_area_vector, patch.ring_points(points)), np.zeros(3))


def weld_polygons(
    polygons: Sequence[Sequence[Float64Array]], charts: Sequence[int], semantics: Sequence[int], origin: Float64Array
) -> PolygonMesh:
    """Weld polygons to a mesh on a grid.

    Corners closer than `max_weld_m` merge, edges split at corners on them, and collapsed rings are dropped.

    Parameters
    ----------
    polygons : rings (k, 3) of each polygon, world metres.
    charts : chart of each polygon.
    semantics : semantic surface of each polygon.
    origin : (3,) origin of the grid, world metres.
    """
    if not polygons:
        return PolygonMesh(np.zeros((0, 3)), ())
    rings = [ring for polygon in polygons for ring in polygon]
    points, of = weld_corners(np.concatenate(rings), origin)
    index = iter(np.split(of, np.cumsum([len(ring) for ring in rings])[:-1]))
    whole = [
        MeshPolygon(tuple(tuple(next(index).tolist()) for _ in polygon), chart, semantic)
        for polygon, chart, semantic in zip(polygons, charts, semantics, strict=True)
    ]
    return split_edges_at_corners(PolygonMesh(points, tuple(whole)))


def weld_corners(points: Float64Array, origin: Float64Array) -> tuple[Float64Array, Int32Array]:
    """Snap corners to the grid and merge close ones, transitively.

    Parameters
    ----------
    points : (n, 3) world metres.
    origin : (3,) origin of the grid.

    Returns
    -------
    Merged corners (k, 3), and the index (n,) of each corner in them.
    """
    points = origin + np.rint((points - origin) / BODIES.grid_m) * BODIES.grid_m
    tree = KDTree(points)
    near = tree.sparse_distance_matrix(tree, BODIES.max_weld_m, output_type="coo_matrix")
    _, of = connected_components(near, directed=False)
    _, first = np.unique(of, return_index=True)
    return points[first], of


def split_edges_at_corners(mesh: PolygonMesh) -> PolygonMesh:
    """Split edges at corners on them and keep the largest simple part of each ring."""
    used = sorted({corner for patch in mesh.patches for ring in patch.rings for corner in ring})
    tree = KDTree(mesh.points[used]) if used else None
    number = np.array(used)
    on: dict[tuple[int, int], tuple[int, ...]] = {}

    def between(a: int, b: int) -> tuple[int, ...]:
        key = (min(a, b), max(a, b))
        if key not in on:
            assert tree is not None
            start, run = mesh.points[key[0]], mesh.points[key[1]] - mesh.points[key[0]]
            length = float(np.linalg.norm(run))
            near = number[tree.query_ball_point(start + run / 2, length / 2 + BODIES.max_off_edge_m)]
            step = (mesh.points[near] - start) @ run / length
            off = np.linalg.norm(mesh.points[near] - start - step[:, None] * run / length, axis=1)
            met = (
                (off < BODIES.max_off_edge_m) & (step > BODIES.max_off_edge_m) & (step < length - BODIES.max_off_edge_m)
            )
            on[key] = tuple(near[met][np.argsort(step[met], kind="stable")].tolist())
        return on[key] if a < b else on[key][::-1]

    def split(ring: tuple[int, ...]) -> tuple[int, ...]:
        full: list[int] = []
        for a, b in zip(ring, ring[1:] + ring[:1], strict=True):
            if a != b:
                full += [a, *between(a, b)]
        return _largest_simple_ring(full, mesh.points)

    patches = []
    for patch in mesh.patches:
        rings = [split(ring) for ring in patch.rings]
        if rings[0]:
            patches.append(replace(patch, rings=tuple(ring for ring in rings if ring)))
    return PolygonMesh(mesh.points, tuple(patches))


def _largest_simple_ring(ring: list[int], points: Float64Array) -> tuple[int, ...]:
    """Return the largest part of a ring that visits no corner twice; empty without area."""
    while len(set(ring)) < len(ring):
        seen: dict[int, int] = {}
        for k, corner in enumerate(ring):
            if corner in seen:
                inside, outside = ring[seen[corner] : k], ring[: seen[corner]] + ring[k:]
                ring = max(inside, outside, key=lambda part: _ring_area(part, points))
                break
            seen[corner] = k
    return tuple(ring) if _ring_area(ring, points) > BODIES.grid_m * BODIES.max_weld_m else ()


def _ring_area(ring: Sequence[int], points: Float64Array) -> float:
    return float(np.linalg.norm(ring_area_vector(points[list(ring)]))) if len(ring) > 2 else 0.0


def count_edges(patches: Sequence[MeshPolygon]) -> Counter[tuple[int, int]]:
    """Count the directed edges."""
    return Counter(edge for patch in patches for edge in patch.edges())


def open_edges(patches: Sequence[MeshPolygon]) -> list[tuple[int, int]]:
    """Return the directed edges without a counterpart, ascending, with multiplicity."""
    count = count_edges(patches)
    return [edge for edge in sorted(count) for _ in range(count[edge] - count[edge[1], edge[0]])]


def is_closed(patches: Sequence[MeshPolygon]) -> bool:
    """Return True if every edge occurs once in each direction, that is, the shell is watertight and oriented."""
    count = count_edges(patches)
    return bool(count) and all(n == 1 and count[b, a] == 1 for (a, b), n in count.items())


def polygon_components(patches: Sequence[MeshPolygon]) -> list[list[int]]:
    """Group patches that are connected by edges, ordered by their first."""
    of: dict[tuple[int, int], int] = {}
    pairs = []
    for i, patch in enumerate(patches):
        for a, b in patch.edges():
            pairs.append((i, of.setdefault((min(a, b), max(a, b)), i)))
    if not pairs:
        return []
    one, other = np.array(pairs).T
    graph = coo_matrix((np.ones(len(one), bool), (one, other)), shape=(len(patches), len(patches)))
    _, label = connected_components(graph, directed=False)
    return [members.tolist() for members in group_rows(label).values()]


def trace_loops(edges: Sequence[tuple[int, int]]) -> list[tuple[int, ...]]:
    """Trace closed loops along directed edges, each corner once per loop; dead ends are dropped."""
    after: dict[int, list[int]] = {}
    for a, b in edges:
        after.setdefault(a, []).append(b)
    found: list[tuple[int, ...]] = []
    for start in sorted(after):
        while after.get(start):
            path, place = [start], {start: 0}
            while after.get(path[-1]):
                corner = after[path[-1]].pop()
                if corner in place:
                    ring = path[place[corner] :]
                    found.append(tuple(ring))
                    del path[place[corner] + 1 :]
                    for gone in ring[1:]:
                        del place[gone]
                else:
                    place[corner] = len(path)
                    path.append(corner)
    return [ring for ring in found if len(ring) > 2]


def triangulate_nonplanar_polygons(mesh: PolygonMesh) -> PolygonMesh:
    """Replace polygons that are not planar by their constrained Delaunay triangles."""
    patches: list[MeshPolygon] = []
    for patch in mesh.patches:
        patches += _split_nonplanar(patch, mesh.points)
    return PolygonMesh(mesh.points, tuple(patches))


def _split_nonplanar(patch: MeshPolygon, points: Float64Array) -> list[MeshPolygon]:
    if sum(map(len, patch.rings)) == 3:
        return [patch]
    corners = np.array([corner for ring in patch.rings for corner in ring])
    normal = polygon_area_vector(patch, points)
    normal = normal / max(float(np.linalg.norm(normal)), 1e-12)
    offset = points[corners] - points[corners].mean(axis=0)
    triangles = triangulate_mesh_polygon(patch, points)
    if not len(triangles):
        return [patch]
    sides = np.array([ring_area_vector(points[ring]) for ring in triangles])
    turned = (sides @ normal) < BODIES.min_normal_cosine * np.linalg.norm(sides, axis=1)
    if np.abs(offset @ normal).max() <= BODIES.max_off_plane_m and not turned.any():
        return [patch]
    return [replace(patch, rings=(tuple(ring),)) for ring in triangles.tolist()]


def triangulate_mesh_polygon(patch: MeshPolygon, points: Float64Array) -> Int64Array:
    """Triangulate a polygon to corner indices (t, 3) with all edges kept; empty if it crosses itself."""
    normal = polygon_area_vector(patch, points)
    size = float(np.linalg.norm(normal))
    if size < 1e-12:
        return np.zeros((0, 3), np.int64)
    axes, origin = plane_axes(normal / size), points[patch.rings[0][0]]
    place = {corner: tuple(((points[corner] - origin) @ axes.T).tolist()) for ring in patch.rings for corner in ring}
    back = {at: corner for corner, at in place.items()}
    rings = [[place[corner] for corner in ring] for ring in patch.rings]
    polygon = shapely.Polygon(rings[0], rings[1:])
    if not polygon.is_valid:
        return np.zeros((0, 3), np.int64)
    parts = shapely.orient_polygons(shapely.get_parts(shapely.constrained_delaunay_triangles(polygon)))
    return np.array([[back[at] for at in part.exterior.coords[:-1]] for part in parts], np.int64).reshape(-1, 3)


def plane_axes(normal: Float64Array) -> Float64Array:
    """Return right and up (2, 3) of a plane as seen against its unit normal."""
    away = np.array([1.0, 0.0, 0.0]) if abs(normal[2]) > 0.9 else np.array([0.0, 0.0, 1.0])
    right = np.cross(away, normal)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(normal, right)])
