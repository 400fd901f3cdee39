"""Cutting of walls, level surfaces and facets on the world grid."""

from __future__ import annotations

import numpy as np
import shapely
from shapely import Polygon

from facade_core.core.arrays import Float32Array, Float64Array, Int64Array
from facade_core.geometry.settings import CUTTING


def grid_crossings(a: Float64Array, b: Float64Array, length: float, grid: float) -> Float64Array:
    """Compute the distances at which a wall crosses the world grid.

    Parameters
    ----------
    a, b : (2,) ends of the wall.
    length : metres between them.
    grid : step of the world grid in metres.

    Returns
    -------
    (k,) ascending metres from `a`, both ends included.
    """
    crossings = [np.array([0.0, length])]
    for axis in range(2):
        low, high = sorted((a[axis], b[axis]))
        lines = np.arange(np.ceil(low / grid), np.floor(high / grid) + 1) * grid
        if high - low > 1e-9:
            crossings.append((lines - a[axis]) / (b[axis] - a[axis]) * length)
    cuts = np.unique(np.round(np.clip(np.concatenate(crossings), 0, length), 6))
    keep = np.concatenate([[True], np.diff(cuts) > CUTTING.min_wall_piece_m])
    keep[-1], keep[0] = True, True
    if len(cuts) > 2 and cuts[-1] - cuts[keep][-2] <= CUTTING.min_wall_piece_m:
        keep[np.flatnonzero(keep)[-2]] = False
    kept: Float64Array = cuts[keep]
    return kept


def cut_polygon_on_grid(polygon: Polygon, grid: float) -> list[Polygon]:
    """Cut a polygon on the cell borders of the world grid and return its parts, row by row.

    A part does not depend on where the polygon's rings begin. Each cell is intersected with the polygon near it only:
    with holes that reach it, and with a frame in place of an outline that does not. Edges that cross the cell's border
    stay whole, so that each part equals one cut from the whole polygon to the bit.
    """
    west, south, east, north = polygon.bounds
    columns = np.arange(np.floor(west / grid), np.ceil(east / grid))
    rows = np.arange(np.floor(south / grid), np.ceil(north / grid))
    row, column = (index.ravel() for index in np.meshgrid(rows, columns, indexing="ij"))
    boxes = shapely.box(column * grid, row * grid, (column + 1) * grid, (row + 1) * grid)
    outline = shapely.Polygon(polygon.exterior)
    shapely.prepare(outline)
    boxes = boxes[shapely.intersects(outline, boxes)]
    inside = shapely.contains_properly(outline, boxes)
    holes = np.array(polygon.interiors, object)
    cell, hole = shapely.STRtree(holes).query(boxes, predicate=None)
    order = np.lexsort((hole, cell))
    ends = np.searchsorted(cell[order], np.arange(len(boxes) + 1))
    parts: list[Polygon] = []
    for box, within, near in zip(boxes, inside, np.split(hole[order], ends[1:-1]), strict=True):
        rings = holes[near].tolist()
        frame = (
            shapely.box(*shapely.total_bounds([box, *rings])).buffer(grid, join_style="mitre") if within else polygon
        )
        local = shapely.Polygon(frame.exterior, rings)
        parts += shapely.get_parts(shapely.normalize(shapely.intersection(local, box))).tolist()
    return [part for part in parts if part.geom_type == "Polygon" and not part.is_empty]


def cut_triangles_on_grid(
    vertices: Float64Array, triangles: Int64Array, uv: Float32Array, grid: float
) -> tuple[Float64Array, Int64Array, Float32Array, Int64Array, Int64Array]:
    """Cut triangles on the planes of the world grid, along the axes on which together they exceed a cell.

    Parameters
    ----------
    vertices : (v, 3) metres.
    triangles : (t, 3).
    uv : (t, 3, 2) texture coordinates of the corners.
    grid : step of the world grid in metres.

    Returns
    -------
    Vertices with those on the cuts appended; triangles and uv of the parts; (p,) source triangle and (p,) cell number.
    """
    source = np.arange(len(triangles))
    corners = vertices[triangles].reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    axes = np.flatnonzero(high - low > grid).tolist()
    for axis in axes:
        for at in np.arange(np.floor(low[axis] / grid) + 1, np.ceil(high[axis] / grid)) * grid:
            vertices, triangles, uv, part = _split_at_plane(vertices, triangles, uv, axis, at)
            source = source[part]
    middle = vertices[triangles].mean(axis=1)[:, axes]
    cell = np.unique(np.floor(middle / grid), axis=0, return_inverse=True)[1].reshape(-1)
    return vertices, triangles, uv, source, cell


def _split_at_plane(
    vertices: Float64Array, triangles: Int64Array, uv: Float32Array, axis: int, at: float
) -> tuple[Float64Array, Int64Array, Float32Array, Int64Array]:
    """Split triangles that cross a plane in two or three; the fourth value is the source triangle of each part."""
    height = vertices[:, axis] - at
    height[np.abs(height) < CUTTING.on_plane_m] = 0
    side = np.sign(height)[triangles]
    cross = np.flatnonzero((side.min(axis=1) < 0) & (side.max(axis=1) > 0))
    rest = np.setdiff1d(np.arange(len(triangles)), cross)
    # rotate the corner first that is alone on its side, or on the plane: its sign is minus the sum of all, or zero
    total = side[cross].sum(axis=1)
    first = np.argmax(side[cross] == -total[:, None], axis=1)
    turn = (first[:, None] + np.arange(3)) % 3
    corner = np.take_along_axis(triangles[cross], turn, axis=1)
    place = np.take_along_axis(uv[cross], turn[..., None], axis=1)
    two, three = np.flatnonzero(total == 0), np.flatnonzero(total != 0)
    a, b, c = corner.T
    pairs = np.concatenate(
        [np.stack([b, c], axis=1)[two], np.stack([a, b], axis=1)[three], np.stack([a, c], axis=1)[three]]
    )
    edges, edge = np.unique(np.sort(pairs, axis=1), axis=0, return_inverse=True)
    share = height[edges[:, 0]] / (height[edges[:, 0]] - height[edges[:, 1]])
    points = vertices[edges[:, 0]] + share[:, None] * (vertices[edges[:, 1]] - vertices[edges[:, 0]])
    points[:, axis] = at
    edge = edge.reshape(-1)
    new = edge + len(vertices)
    along = np.where(pairs[:, 0] == edges[edge, 0], share[edge], 1 - share[edge])[:, None]
    m2, mb, mc = np.split(np.arange(len(pairs)), [len(two), len(two) + len(three)])
    uv2 = place[two, 1] + along[m2] * (place[two, 2] - place[two, 1])
    uvb = place[three, 0] + along[mb] * (place[three, 1] - place[three, 0])
    uvc = place[three, 0] + along[mc] * (place[three, 2] - place[three, 0])
    parts = [
        (a[two], b[two], new[m2], place[two, 0], place[two, 1], uv2, two),
        (a[two], new[m2], c[two], place[two, 0], uv2, place[two, 2], two),
        (a[three], new[mb], new[mc], place[three, 0], uvb, uvc, three),
        (new[mb], b[three], c[three], uvb, place[three, 1], place[three, 2], three),
        (new[mb], c[three], new[mc], uvb, place[three, 2], uvc, three),
    ]
    return (
        np.concatenate([vertices, points]),
        np.concatenate([triangles[rest], *(np.stack(part[:3], axis=1) for part in parts)]),
        np.concatenate([uv[rest], *(np.stack(part[3:6], axis=1) for part in parts)]).astype(uv.dtype),
        np.concatenate([rest, *(cross[part[6]] for part in parts)]),
    )
