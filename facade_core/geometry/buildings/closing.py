"""Missing walls of modelled shells: party walls that the source left to a neighbour, and sides cut off with an area."""

from __future__ import annotations

import numpy as np
import shapely

from facade_core.core.arrays import BoolArray, Float64Array, Int64Array
from facade_core.core.fixed_order import multiply_matrices
from facade_core.geometry.buildings.curtains import Curtain, curtains_below_edges
from facade_core.geometry.buildings.facets import Facets
from facade_core.geometry.buildings.settings import CLOSING, FACETS
from facade_core.geometry.charts import ChartKind


def missing_walls(facets: Facets) -> Facets | None:
    """Compute the walls that a shell lacks below its roofs and between its walls; None if it lacks none.

    Open edges get walls down to the foot of the shell, as far as no other wall is there. The edge of an overhanging
    roof, a roof on posts, and a scan get none.
    """
    corners = facets.vertices[facets.triangles]
    if not len(corners):
        return None
    base = float(corners[..., 2].min())
    open_ = _open_edges(facets, base)
    if len(open_) > CLOSING.max_open_edges:
        return None
    edges = [(facets.vertices[b], facets.vertices[a]) for a, b in open_]
    curtains = [one for one in curtains_below_edges(edges, base) if _is_wide(one) and not _has_wall(one, facets)]
    area = triangle_areas(facets)[facets.kind[facets.facet] == ChartKind.WALL].sum()
    missing = sum(one.shape.area for one in curtains)
    if not curtains or area < CLOSING.min_wall_share * (area + missing):
        return None
    return _curtain_facets(curtains)


def concatenate_facets(first: Facets, second: Facets) -> Facets:
    """Return the facets of both, those of `first` first, with vertices in one place merged."""
    vertices = np.concatenate([first.vertices, second.vertices])
    cell = np.round(vertices / FACETS.weld_m).astype(np.int64)
    _, kept, to = np.unique(cell, axis=0, return_index=True, return_inverse=True)
    return Facets(
        vertices=vertices[kept],
        triangles=to.ravel()[np.concatenate([first.triangles, second.triangles + len(first.vertices)])],
        facet=np.concatenate([first.facet, second.facet + len(first)]),
        texture=np.concatenate([first.texture, second.texture]),
        uv=np.concatenate([first.uv, second.uv]),
        kind=np.concatenate([first.kind, second.kind]),
        normal=np.concatenate([first.normal, second.normal]),
    )


def triangle_areas(facets: Facets) -> Float64Array:
    """Return the area of each triangle, (t,) square metres."""
    a, b, c = np.moveaxis(facets.vertices[facets.triangles], 1, 0)
    areas: Float64Array = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return areas


def open_edge_mask(facets: Facets) -> tuple[Int64Array, BoolArray]:
    """Return the directed edges (3 t, 2) of the triangles, and which of them no other triangle continues."""
    edges = np.concatenate([facets.triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    key = np.sort(edges, axis=1) @ [len(facets.vertices), 1]
    _, of, uses = np.unique(key, return_inverse=True, return_counts=True)
    return edges, uses[of] == 1


def _open_edges(facets: Facets, base: float) -> list[tuple[int, int]]:
    """Return the open edges without the foot of the walls."""
    edges, is_open = open_edge_mask(facets)
    is_wall = np.tile(facets.kind[facets.facet], 3) == ChartKind.WALL
    is_foot = is_wall & (facets.vertices[edges][..., 2].max(axis=1) < base + CLOSING.max_foot_m)
    return [(int(a), int(b)) for a, b in edges[is_open & ~is_foot]]


def _is_wide(curtain: Curtain) -> bool:
    x0, z0, x1, z1 = curtain.shape.bounds
    return bool(curtain.shape.area >= CLOSING.min_missing_m2 and min(x1 - x0, z1 - z0) >= CLOSING.min_missing_m)


def _outward(curtain: Curtain) -> Float64Array:
    """Return the normal (3,) of a curtain."""
    right = np.array([curtain.along[1], -curtain.along[0], 0.0])
    return -right if not curtain.shape.exterior.is_ccw else right


def _has_wall(curtain: Curtain, facets: Facets) -> bool:
    """Return whether most of a curtain has a wall in its place, or a parallel one closely behind it."""
    outward = _outward(curtain)
    cosine = multiply_matrices(facets.normal, outward)[facets.facet]
    is_wall = (facets.kind[facets.facet] == ChartKind.WALL) & (np.abs(cosine) > CLOSING.min_parallel_cosine)
    corners, cosine = facets.vertices[facets.triangles[is_wall]], cosine[is_wall]
    behind = -multiply_matrices(corners[..., :2] - curtain.origin, outward[:2])
    reach = np.where(cosine > 0, CLOSING.max_overhang_m, CLOSING.max_joint_m)
    corners = corners[((behind > -CLOSING.max_joint_m) & (behind < reach[:, None])).all(axis=1)]
    along = multiply_matrices(corners[..., :2] - curtain.origin, curtain.along)
    flat = np.stack([along, corners[..., 2] - curtain.base], axis=-1)
    # an overhang's edge is below the top of the wall behind it, or not far above
    flat[..., 1] += np.where(flat[..., 1] > flat[..., 1].min(axis=1, keepdims=True), CLOSING.max_overhang_m, 0.0)
    covered = shapely.union_all(shapely.polygons(flat)) if len(flat) else shapely.Polygon()
    return bool(covered.intersection(curtain.shape).area > CLOSING.min_covered_share * curtain.shape.area)


def _curtain_facets(curtains: list[Curtain]) -> Facets:
    """Return curtains as facets without textures."""
    points, facet, normal = [], [], []
    for number, curtain in enumerate(curtains):
        cut = shapely.get_parts(shapely.constrained_delaunay_triangles(curtain.shape))
        flat = shapely.get_coordinates(shapely.orient_polygons(cut)).reshape(-1, 4, 2)[:, :3]
        outward = _outward(curtain)
        world = curtain.points(flat.reshape(-1, 2)).reshape(-1, 3, 3)
        area = np.cross(world[:, 1] - world[:, 0], world[:, 2] - world[:, 0])
        is_turned = multiply_matrices(area, outward) < 0
        world[is_turned] = world[is_turned][:, ::-1]
        points.append(world)
        facet += [number] * len(world)
        normal.append(outward)
    corners = np.concatenate(points)
    vertices, index = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return Facets(
        vertices=vertices,
        triangles=index.reshape(-1, 3),
        facet=np.array(facet),
        texture=np.full(len(corners), -1, np.int32),
        uv=np.zeros((len(corners), 3, 2), np.float32),
        kind=np.full(len(curtains), ChartKind.WALL, np.uint8),
        normal=np.array(normal),
    )
