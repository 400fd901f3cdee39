"""Walls among walls: what of one stands free of its neighbours, and which go round a bend as one."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from facade_core.core.grouping import group_rows
from facade_core.geometry.charts import ChartKind, Charts, Mesh

# What a wall is to the streets: on one; beside it, in sight but narrow; out of sight.
ROLES = ("street", "side", "back")
STREET, SIDE, BACK = range(len(ROLES))

# A wall that faces another from no farther than this stands against it: party walls, and the joints between buildings.
JOINT_M = 0.5
# Two walls face each other where the cosine between their normals is below this.
OPPOSITE = -0.94
# Triangles of one wall meet within this; so do walls at a corner.
SNAP_M, MEETING_M = 0.001, 0.05
# A bend between two walls that are one: facets narrower than so much, turned by no more than this (cosine).
FACET_M, BEND = 3.0, 0.86
# Feet and tops of walls that are one differ by no more.
LEVEL_M = 0.1
# A wall narrower than this, or lower, is a ledge.
NARROW_M = 0.7
# Walls and roofs that are smaller, square metres, or narrower are trim: edges of roofs, chimneys, skirts.
TRIM_M2, TRIM_M = 2.0, 0.6
# Storeys of a building are from so low to so high where its height allows it.
STOREY_M = (2.6, 4.5)


def taken_whole(charts: Charts) -> np.ndarray:
    """The walls and roofs (n,) bool that are no trim."""
    large = (charts.size.min(axis=1) >= TRIM_M) & (charts.size.prod(axis=1) >= TRIM_M2)
    return ((charts.kind == ChartKind.WALL) | (charts.kind == ChartKind.ROOF)) & large


def free_part(charts: Charts, mesh: Mesh, chart: int) -> tuple[BaseGeometry, BaseGeometry]:
    """A wall's outline, and what of it stands against no other: polygons in its frame, metres, x right and y down. Openings
    that the source gives count as wall."""
    own = _outline(charts, mesh, chart, chart)
    normal = charts.normal()
    near = charts.near(chart, JOINT_M)
    near = near[(charts.kind[near] == ChartKind.WALL) & (normal[near] @ normal[chart] < OPPOSITE)]
    apart = (charts.at_shares(near, np.array([[0.5, 0.5]]))[:, 0] - charts.origin[chart]) @ normal[chart]
    against = [_outline(charts, mesh, other, chart) for other in near[np.abs(apart) <= JOINT_M].tolist()]
    free = shapely.difference(own, shapely.union_all(against, grid_size=SNAP_M), grid_size=SNAP_M)
    # a sliver beside a neighbour whose corners lie elsewhere is none
    open_ = free.buffer(-MEETING_M, join_style="mitre").buffer(MEETING_M, join_style="mitre").intersection(own)
    return own, open_


def free_share(charts: Charts, mesh: Mesh) -> np.ndarray:
    """The share of each chart's area that stands against no wall of a neighbour, (n,): 1 of what is no wall, or narrower or
    lower than NARROW_M."""
    share = np.ones(len(charts))
    for chart in np.flatnonzero((charts.kind == ChartKind.WALL) & (charts.size >= NARROW_M).all(axis=1)).tolist():
        whole, part = free_part(charts, mesh, chart)
        share[chart] = part.area / max(whole.area, SNAP_M**2)
    return share


def _outline(charts: Charts, mesh: Mesh, chart: int, frame: int) -> BaseGeometry:
    """A wall's outline without its holes, in the frame of another."""
    triangles = mesh.triangles[mesh.triangles_of(chart)]
    points = mesh.vertices[triangles.ravel()]
    flat = charts.coordinates(np.full(len(points), frame), points).reshape(-1, 3, 2)
    flat = np.concatenate([flat, flat[:, :1]], axis=1)
    whole = shapely.union_all(shapely.make_valid(shapely.polygons(flat)), grid_size=SNAP_M)
    parts = [shapely.Polygon(part.exterior) for part in shapely.get_parts(whole) if part.geom_type == "Polygon"]
    return shapely.union_all(parts)


def bends(charts: Charts, walls: np.ndarray) -> list[list[int]]:
    """Some walls (k,) in runs that are laid out as one, each from left to right as seen from outside: the facets of what is
    round, and the pieces of one surface; most walls are a run of their own."""
    following: dict[int, int] = {}
    for own in group_rows(charts.building[walls]).values():
        following |= _following(charts, walls[own])
    first = sorted(set(walls.tolist()) - set(following.values()))
    runs, left = [], set(walls.tolist())
    for start in [*first, *sorted(set(walls.tolist()))]:  # a tower all round begins anywhere: at the first of its walls
        run = []
        while start in left:
            left.remove(start)
            run.append(start)
            start = following.get(start, -1)
        if run:
            runs.append(run)
    return sorted(runs)


def _following(charts: Charts, walls: np.ndarray) -> dict[int, int]:
    """Of walls (k,) of one building, the one to the right with which each is one."""
    foot = charts.at_shares(walls, np.array([[0.0, 1.0], [1.0, 1.0]]))
    top = charts.origin[walls, 2]
    normal, width = charts.normal()[walls], charts.size[walls, 0]
    apart = np.linalg.norm(foot[:, None, 1, :2] - foot[None, :, 0, :2], axis=-1)
    meet = (apart < MEETING_M) & (np.abs(foot[:, None, 1, 2] - foot[None, :, 0, 2]) < LEVEL_M)
    meet &= np.abs(top[:, None] - top) < LEVEL_M
    narrow = width < FACET_M
    one = narrow[:, None] & narrow & (normal @ normal.T > BEND)
    one |= charts.surface[walls][:, None] == charts.surface[walls]
    pairs = np.argwhere(meet & one & ~np.eye(len(walls), dtype=bool))
    return {int(walls[a]): int(walls[b]) for a, b in pairs.tolist()}
