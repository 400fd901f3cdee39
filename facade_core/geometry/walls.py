"""Relations between walls: their free parts, and runs of walls round a bend."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from facade_core.core.arrays import BoolArray, Float64Array, Int64Array
from facade_core.core.grouping import group_rows
from facade_core.geometry.charts import ChartKind, Charts, Mesh

WALL_ROLES = ("street", "side", "back")


class WallRole(IntEnum):
    """Relation of a wall to the streets: the index of its name in `WALL_ROLES`."""

    STREET = 0
    # In sight, but too narrow for a facade.
    SIDE = 1
    # Out of sight.
    BACK = 2


# Metres between two opposite walls up to which they touch: party walls, and the joints between buildings.
MAX_JOINT_M = 0.5
# Cosine between the normals of two walls below which they face each other.
MAX_FACING_COSINE = -0.94
# Grid on which the triangles of one wall meet; metres.
SNAP_M = 0.001
# Metres between the ends of two walls that meet at a corner.
CORNER_TOLERANCE_M = 0.05
# Metres; walls at least as wide are not joined round a bend.
MAX_BEND_FACET_M = 3.0
# Cosine between the normals of two walls that are joined round a bend.
MIN_BEND_COSINE = 0.86
# Metres by which the feet and tops of joined walls may differ.
LEVEL_TOLERANCE_M = 0.1
# Metres; a narrower or lower wall is a ledge.
MIN_WALL_M = 0.7
# Smaller or narrower walls and roofs are details, such as roof edges, chimneys and skirts; square metres and metres.
MIN_MAIN_SURFACE_M2 = 2.0
MIN_MAIN_SURFACE_M = 0.6
# Lowest and greatest floor height in metres, where the height of the building allows it.
FLOOR_HEIGHT_M = (2.6, 4.5)


def main_surface_mask(charts: Charts) -> BoolArray:
    """Mask the charts (n,) that are large walls or roofs, not details."""
    large = (charts.size.min(axis=1) >= MIN_MAIN_SURFACE_M) & (charts.size.prod(axis=1) >= MIN_MAIN_SURFACE_M2)
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
    own = _outline_without_openings(charts, mesh, chart, chart)
    normal = charts.normals()
    near = charts.charts_within(chart, MAX_JOINT_M)
    near = near[(charts.kind[near] == ChartKind.WALL) & (normal[near] @ normal[chart] < MAX_FACING_COSINE)]
    apart = (charts.points_at_shares(near, np.array([[0.5, 0.5]]))[:, 0] - charts.origin[chart]) @ normal[chart]
    against = [
        _outline_without_openings(charts, mesh, other, chart) for other in near[np.abs(apart) <= MAX_JOINT_M].tolist()
    ]
    free = shapely.difference(own, shapely.union_all(against, grid_size=SNAP_M), grid_size=SNAP_M)
    # opening drops slivers along a neighbour with other corners
    open_ = (
        free.buffer(-CORNER_TOLERANCE_M, join_style="mitre")
        .buffer(CORNER_TOLERANCE_M, join_style="mitre")
        .intersection(own)
    )
    return own, open_


def free_wall_shares(charts: Charts, mesh: Mesh) -> Float64Array:
    """Return the share of each chart's area without a neighbour's wall against it, (n,).

    Charts that are no walls, or smaller than MIN_WALL_M, have share 1.
    """
    share = np.ones(len(charts))
    for chart in np.flatnonzero((charts.kind == ChartKind.WALL) & (charts.size >= MIN_WALL_M).all(axis=1)).tolist():
        whole, part = wall_outline_and_free_part(charts, mesh, chart)
        share[chart] = part.area / max(whole.area, SNAP_M**2)
    return share


def _outline_without_openings(charts: Charts, mesh: Mesh, chart: int, frame: int) -> BaseGeometry:
    """Return a wall's outline without its holes, in the frame of another chart."""
    triangles = mesh.triangles[mesh.chart_triangles(chart)]
    points = mesh.vertices[triangles.ravel()]
    flat = charts.coordinates(np.full(len(points), frame), points).reshape(-1, 3, 2)
    flat = np.concatenate([flat, flat[:, :1]], axis=1)
    whole = shapely.union_all(shapely.make_valid(shapely.polygons(flat)), grid_size=SNAP_M)
    parts = [shapely.Polygon(part.exterior) for part in shapely.get_parts(whole) if part.geom_type == "Polygon"]
    return shapely.union_all(parts)


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
    top = charts.origin[walls, 2]
    normal, width = charts.normals()[walls], charts.size[walls, 0]
    apart = np.linalg.norm(foot[:, None, 1, :2] - foot[None, :, 0, :2], axis=-1)
    meet = (apart < CORNER_TOLERANCE_M) & (np.abs(foot[:, None, 1, 2] - foot[None, :, 0, 2]) < LEVEL_TOLERANCE_M)
    meet &= np.abs(top[:, None] - top) < LEVEL_TOLERANCE_M
    narrow = width < MAX_BEND_FACET_M
    one = narrow[:, None] & narrow & (normal @ normal.T > MIN_BEND_COSINE)
    one |= charts.surface[walls][:, None] == charts.surface[walls]
    pairs = np.argwhere(meet & one & ~np.eye(len(walls), dtype=bool))
    return {int(walls[a]): int(walls[b]) for a, b in pairs.tolist()}
