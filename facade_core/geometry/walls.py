"""Relations between walls: their free parts, and runs of walls round a bend."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from facade_core.core.arrays import BoolArray, Float64Array, Int64Array, ObjectArray
from facade_core.core.grouping import group_rows
from facade_core.geometry.charts import ChartKind, Charts, Mesh
from facade_core.geometry.settings import FACADE_WALLS

WALL_ROLES = ("street", "side", "back")


class WallRole(IntEnum):
    """Relation of a wall to the streets: the index of its name in `WALL_ROLES`."""

    STREET = 0
    # In sight, but too narrow for a facade.
    SIDE = 1
    # Out of sight.
    BACK = 2


def main_surface_mask(charts: Charts) -> BoolArray:
    """Mask the charts (n,) that are large walls or roofs, not details."""
    large = (charts.size.min(axis=1) >= FACADE_WALLS.min_main_surface_m) & (
        charts.size.prod(axis=1) >= FACADE_WALLS.min_main_surface_m2
    )
    is_main: BoolArray = ((charts.kind == ChartKind.WALL) | (charts.kind == ChartKind.ROOF)) & large
    return is_main


def wall_outline_and_free_part(charts: Charts, mesh: Mesh, chart: int) -> tuple[BaseGeometry, BaseGeometry]:
    """Return a wall's outline, and the part of it without a neighbour's wall against it.

    Parameters
    ----------
    chart : index of the wall.

    Returns
    -------
    Polygons in the wall's frame, metres, x right and y down; openings of the source count as wall.
    """
    whole, free = wall_outlines_and_free_parts(charts, mesh, np.array([chart]))
    return whole[0], free[0]


def free_wall_shares(charts: Charts, mesh: Mesh) -> Float64Array:
    """Return the share of each chart's area without a neighbour's wall against it, (n,).

    Charts that are no walls, or smaller than `min_wall_m`, have share 1.
    """
    share = np.ones(len(charts))
    walls = np.flatnonzero((charts.kind == ChartKind.WALL) & (charts.size >= FACADE_WALLS.min_wall_m).all(axis=1))
    for first in range(0, len(walls), FACADE_WALLS.walls_per_batch):
        batch = walls[first : first + FACADE_WALLS.walls_per_batch]
        whole, free = wall_outlines_and_free_parts(charts, mesh, batch)
        share[batch] = shapely.area(free) / np.maximum(shapely.area(whole), FACADE_WALLS.snap_m**2)
    return share


def wall_outlines_and_free_parts(charts: Charts, mesh: Mesh, walls: Int64Array) -> tuple[ObjectArray, ObjectArray]:
    """Return the outlines of walls (k,), and their parts without a neighbour's wall against them, in their frames."""
    own = _outlines_without_openings(charts, mesh, walls, walls)
    normal = charts.normals()
    row, near = charts.pairs_within(walls, FACADE_WALLS.max_joint_m)
    facing = charts.kind[near] == ChartKind.WALL
    facing[facing] = (
        np.einsum("ij,ij->i", normal[near[facing]], normal[walls[row[facing]]]) < FACADE_WALLS.max_facing_cosine
    )
    row, near = row[facing], near[facing]
    middle = charts.points_at_shares(near, np.array([[0.5, 0.5]]))[:, 0]
    apart = np.einsum("ij,ij->i", middle - charts.origin[walls[row]], normal[walls[row]])
    row, near = row[np.abs(apart) <= FACADE_WALLS.max_joint_m], near[np.abs(apart) <= FACADE_WALLS.max_joint_m]
    against = _union_by_row(
        _outlines_without_openings(charts, mesh, near, walls[row]), row, len(walls), FACADE_WALLS.snap_m
    )
    free = shapely.difference(own, against, grid_size=FACADE_WALLS.snap_m)
    # opening drops slivers along a neighbour with other corners
    eroded = shapely.buffer(free, -FACADE_WALLS.corner_tolerance_m, join_style="mitre")
    open_: ObjectArray = shapely.intersection(
        shapely.buffer(eroded, FACADE_WALLS.corner_tolerance_m, join_style="mitre"), own
    )
    return own, open_


def _outlines_without_openings(charts: Charts, mesh: Mesh, walls: Int64Array, frames: Int64Array) -> ObjectArray:
    """Return the outlines of walls (k,) without their holes, each in the frame of another chart (k,)."""
    triangles = [mesh.chart_triangles(wall) for wall in walls.tolist()]
    row = np.repeat(np.arange(len(walls)), list(map(len, triangles)))
    corners = mesh.triangles[np.concatenate([*triangles, np.zeros(0, np.int64)])].ravel()
    flat = charts.coordinates(np.repeat(frames[row], 3), mesh.vertices[corners]).reshape(-1, 3, 2)
    flat = np.concatenate([flat, flat[:, :1]], axis=1)
    whole = _union_by_row(shapely.make_valid(shapely.polygons(flat)), row, len(walls), FACADE_WALLS.snap_m)
    parts, row = shapely.get_parts(whole, return_index=True)
    polygon = shapely.get_type_id(parts) == shapely.GeometryType.POLYGON
    outlines = shapely.polygons(shapely.get_exterior_ring(parts[polygon]))
    return _union_by_row(outlines, row[polygon], len(walls))


def _union_by_row(parts: ObjectArray, row: Int64Array, count: int, grid: float | None = None) -> ObjectArray:
    """Return the union (count,) of the parts (k,) of each ascending row (k,), empty without any."""
    collections = np.full(count, shapely.GeometryCollection(), object)
    shapely.geometrycollections(parts, indices=row, out=collections)
    unions: ObjectArray = shapely.union_all(collections[:, None], axis=1, grid_size=grid)
    return unions


def group_walls_into_runs(charts: Charts, walls: Int64Array) -> list[list[int]]:
    """Group walls (k,) into runs that are laid out as one, from left to right seen from outside.

    A run is a rounded wall of several facets, or the pieces of one surface; most walls form their own run.
    """
    following: dict[int, int] = {}
    for own in group_rows(charts.building[walls]).values():
        following |= _right_neighbours(charts, walls[own])
    first = sorted(set(walls.tolist()) - set(following.values()))
    runs, left = [], set(walls.tolist())
    for start in [*first, *sorted(set(walls.tolist()))]:  # a closed ring of walls starts at its first wall
        run = []
        while start in left:
            left.remove(start)
            run.append(start)
            start = following.get(start, -1)
        if run:
            runs.append(run)
    return sorted(runs)


def _right_neighbours(charts: Charts, walls: Int64Array) -> dict[int, int]:
    """Map walls (k,) of one building to the wall on the right that continues them."""
    foot = charts.points_at_shares(walls, np.array([[0.0, 1.0], [1.0, 1.0]]))
    top, normal, narrow = (
        charts.origin[walls, 2],
        charts.normals()[walls],
        charts.size[walls, 0] < FACADE_WALLS.max_bend_facet_m,
    )
    starts = shapely.STRtree(shapely.points(foot[:, 0, :2]))
    pairs = starts.query(
        shapely.points(foot[:, 1, :2]), predicate="dwithin", distance=2 * FACADE_WALLS.corner_tolerance_m
    )
    left, right = pairs[:, np.lexsort(pairs[::-1])]
    apart = np.linalg.norm(foot[left, 1, :2] - foot[right, 0, :2], axis=-1)
    meet = (apart < FACADE_WALLS.corner_tolerance_m) & (
        np.abs(foot[left, 1, 2] - foot[right, 0, 2]) < FACADE_WALLS.level_tolerance_m
    )
    meet &= (np.abs(top[left] - top[right]) < FACADE_WALLS.level_tolerance_m) & (left != right)
    bent = (
        narrow[left]
        & narrow[right]
        & (np.einsum("ij,ij->i", normal[left], normal[right]) > FACADE_WALLS.min_bend_cosine)
    )
    meet &= bent | (charts.surface[walls[left]] == charts.surface[walls[right]])
    return dict(zip(walls[left[meet]].tolist(), walls[right[meet]].tolist(), strict=True))
