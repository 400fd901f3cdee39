"""Street centrelines from building footprints: the medial axis of the gaps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from facade_core.core.arrays import BoolArray, Float64Array, Int64Array, ObjectArray
from facade_core.core.errors import GeometryError
from facade_core.core.types import Street
from facade_core.geometry.ground.settings import GAPS

# Cosine of the turn up to which a street continues through a junction: 50 degrees.
_MIN_STRAIGHT_COSINE = np.cos(np.radians(50.0))


def derive_streets(footprints: Sequence[Polygon], *, reach: float = 15.0) -> tuple[Street, ...]:
    """Derive streets along the gaps between buildings, named g0, g1, ... from south-west to north-east.

    Streets follow the medial axis of the free space within `reach` of a building: the middle of gaps up to about 2 x
    reach wide, else half of `reach` from the walls, so that a lone building has a ring around it. Gaps narrower than
    `min_gap_m` and yards (enclosed free space below `min_square_m2`) carry none. Lines are smoothed. The order of the
    footprints does not matter.

    Parameters
    ----------
    footprints : valid polygons in metres; they may touch and overlap.
    reach : metres from buildings.

    Raises
    ------
    GeometryError Where a coordinate is not finite, or `reach` is not above `min_gap_m`.
    """
    if not reach > GAPS.min_gap_m:
        raise GeometryError(
            f"reach {reach:g} m leaves no street between walls and its border; give more than {GAPS.min_gap_m:g}"
        )
    for index, footprint in enumerate(footprints):
        if not np.isfinite(shapely.get_coordinates(footprint)).all():
            raise GeometryError(f"footprint {index} has coordinates that are not finite; repair or remove it")
    outlines = np.array([footprint for footprint in footprints if not footprint.is_empty], dtype=object)
    if len(outlines) == 0:
        return ()
    bounds = shapely.bounds(outlines)
    # Qhull squares coordinates: near the origin no digits are lost. The origin is on a grid, so that streets do not
    # move when the block changes elsewhere.
    corner = np.floor(bounds[:, :2].min(axis=0) / GAPS.origin_grid_m) * GAPS.origin_grid_m
    outlines = shapely.transform(outlines[np.lexsort(bounds.T)], lambda xy: xy - corner)

    solid = _blocked_ground(outlines)
    open_strip = reach / 5  # gaps this much wider than twice the reach still have one street, not one along each side
    zone = _street_zone(solid, reach, open_strip)
    branches = _prune_spurs(_medial_axis(solid, zone, widest=reach + open_strip))
    walls = shapely.STRtree(outlines)
    lines = [
        _orient_line(_smooth_line(line, walls)) for line in _join_branches(branches) if line.length >= GAPS.min_length_m
    ]
    lines.sort(key=lambda line: (*_diagonal_order(np.array(line.coords[0])), line.length))
    return tuple(
        Street(f"g{index}", None, shapely.transform(line, lambda xy: np.round(xy + corner, 3)))
        for index, line in enumerate(lines)
    )


def _blocked_ground(outlines: ObjectArray) -> BaseGeometry:
    """Return ground without streets: buildings, narrow gaps and yards."""
    grown = shapely.union_all(shapely.buffer(outlines, GAPS.min_gap_m / 2, quad_segs=4))
    filled = shapely.union_all([_without_holes(part, below=GAPS.min_square_m2) for part in shapely.get_parts(grown)])
    return shapely.buffer(filled, -GAPS.min_gap_m / 2, quad_segs=4)


def _street_zone(solid: BaseGeometry, reach: float, strip: float) -> BaseGeometry:
    """Return the ground within reach of a building, and open strips between such ground narrower than 2 x `strip`."""
    parts = shapely.buffer(shapely.get_parts(solid), reach + strip, quad_segs=8)
    return shapely.buffer(shapely.union_all(parts), -strip, quad_segs=8)


def _without_holes(polygon: Polygon, *, below: float) -> Polygon:
    return Polygon(polygon.exterior, [hole for hole in polygon.interiors if Polygon(hole).area >= below])


def _medial_axis(solid: BaseGeometry, zone: BaseGeometry, *, widest: float) -> ObjectArray:
    """Return lines of the medial axis of the zone less the solid, with the clearance as z.

    These are Voronoi edges between opposite outline points, computed tile by tile: points beyond twice the widest
    clearance do not affect an edge.
    """
    free = shapely.difference(zone, solid)
    points = np.unique(np.round(shapely.get_coordinates(shapely.segmentize(free, GAPS.sampling_m)), 3), axis=0)
    shapely.prepare(free)
    found = []
    for west in np.arange(points[0, 0], points[-1, 0] + GAPS.tile_m, GAPS.tile_m):
        first, last = np.searchsorted(points[:, 0], [west - 2 * widest, west + GAPS.tile_m + 2 * widest])
        column = points[first:last]
        column = column[np.argsort(column[:, 1], kind="stable")]
        for south in np.arange(points[:, 1].min(), points[:, 1].max() + GAPS.tile_m, GAPS.tile_m):
            first, last = np.searchsorted(column[:, 1], [south - 2 * widest, south + GAPS.tile_m + 2 * widest])
            if last - first > 4:
                edges = _voronoi_edges(column[first:last], free)
                middle = edges[..., :2].mean(axis=1)
                inside = ((middle >= (west, south)) & (middle < (west + GAPS.tile_m, south + GAPS.tile_m))).all(axis=1)
                found.append(_merge_pieces(shapely.linestrings(edges[inside])))
    return _merge_pieces(np.concatenate(found))


def _voronoi_edges(points: Float64Array, free: BaseGeometry) -> Float64Array:
    """Return Voronoi edges (e, 2, 3) inside `free` between points at least `min_gap_m` apart, with the clearance as z."""
    from scipy.spatial import Voronoi

    diagram = Voronoi(points)
    ends, between = np.asarray(diagram.ridge_vertices), diagram.ridge_points
    keep = (ends >= 0).all(axis=1) & (np.linalg.norm(np.diff(points[between], axis=1)[:, 0], axis=1) >= GAPS.min_gap_m)
    ends, between = ends[keep], between[keep]
    # Tiles must agree on a vertex, and vertices between points in whole millimetres are often at half ones.
    vertices = np.round(diagram.vertices + 2e-4, 3)
    clearance = np.zeros(len(vertices))
    clearance[ends] = np.linalg.norm(vertices[ends] - points[between[:, :1]], axis=2)
    inside = clearance >= GAPS.min_gap_m / 2
    inside[inside] = shapely.contains_xy(free, vertices[inside])
    ends = ends[inside[ends].all(axis=1)]
    ends = ends[(vertices[ends[:, 0]] != vertices[ends[:, 1]]).any(axis=1)]
    edges: Float64Array = np.column_stack([vertices, clearance])[ends]
    return edges


def _merge_pieces(pieces: ObjectArray) -> ObjectArray:
    """Join pieces wherever exactly two meet."""
    merged: ObjectArray = shapely.get_parts(shapely.line_merge(shapely.multilinestrings(pieces)))
    return merged


def _branch_nodes(branches: ObjectArray) -> tuple[Float64Array, Int64Array]:
    """Return the end nodes (n, 3) of branches, with the clearance as z, and the start and end node of each branch (b, 2)."""
    ends = np.stack([shapely.get_coordinates(shapely.get_point(branches, k), include_z=True) for k in (0, -1)], axis=1)
    _, first, node = np.unique(ends.reshape(-1, 3)[:, :2], axis=0, return_index=True, return_inverse=True)
    return ends.reshape(-1, 3)[first], node.reshape(-1, 2)


def _prune_spurs(branches: ObjectArray) -> ObjectArray:
    """Drop branches that lead only into corners, and shorten blind ones to where their corner begins."""
    while True:
        places, node = _branch_nodes(branches)
        blind = np.bincount(node.ravel(), minlength=len(places))[node] == 1
        spur = np.zeros(len(branches), bool)
        for index in np.flatnonzero(blind[:, 0] != blind[:, 1]):
            coords = shapely.get_coordinates(branches[index], include_z=True)
            rest = _drop_wedge(coords if blind[index, 0] else coords[::-1])
            spur[index] = _path_length(rest) < GAPS.min_spur_ratio * rest[-1, 2]
        if not spur.any():
            break
        branches = _merge_pieces(branches[~spur])
    for index in np.flatnonzero(blind.any(axis=1)):
        coords = shapely.get_coordinates(branches[index], include_z=True)
        coords = _drop_wedge(coords) if blind[index, 0] else coords
        coords = _drop_wedge(coords[::-1])[::-1] if blind[index, 1] else coords
        branches[index] = LineString(coords)
    return branches


def _drop_wedge(coords: Float64Array) -> Float64Array:
    """Return a branch (n, 3) from its blind tip on, without the part where the walls diverge from a corner."""
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(coords[:, :2], axis=0), axis=1))])
    level = coords[:, 2] - coords[0, 2] < GAPS.min_wedge_gain * travelled - 0.1  # 0.1: the zigzag of the sampling
    start = int(np.argmax(level)) if level.any() else len(coords) - 1
    return coords[min(max(start - 1, 0), len(coords) - 2) :]


def _path_length(coords: Float64Array) -> float:
    return float(np.linalg.norm(np.diff(coords[:, :2], axis=0), axis=1).sum())


def _join_branches(branches: ObjectArray) -> list[LineString]:
    """Join branches to long lines: at each junction the straightest pair first."""
    places, node = _branch_nodes(branches)
    centre, link = _merge_junctions(branches, places, node)
    paths = []
    for index in np.flatnonzero(~link):
        coords = shapely.get_coordinates(branches[index])
        before, after = (places[centre[node[index]], :2])[:, None]
        moved = centre[node[index]] != node[index]
        paths.append(np.concatenate([before[: int(moved[0])], coords, after[: int(moved[1])]]))
    ends = centre[node[~link]].ravel()  # branch b starts with end 2b and stops with end 2b + 1
    partner = np.full(len(ends), -1)
    order = np.argsort(ends, kind="stable")
    for group in np.split(order, np.flatnonzero(np.diff(ends[order])) + 1):
        if len(group) < 2:
            continue
        away = np.array([_start_direction(paths[e // 2][:: 1 - 2 * (e % 2)], places[ends[e], 2] + 5.0) for e in group])
        cosine = -away @ away.T
        rows, columns = np.triu_indices(len(group), 1)
        for k in np.argsort(-np.round(cosine[rows, columns], 6), kind="stable"):
            one, other = group[rows[k]], group[columns[k]]
            if cosine[rows[k], columns[k]] >= _MIN_STRAIGHT_COSINE and partner[one] < 0 and partner[other] < 0:
                partner[one], partner[other] = other, one
    return _chain_paths(paths, ends, partner)


def _merge_junctions(branches: ObjectArray, places: Float64Array, node: Int64Array) -> tuple[Int64Array, BoolArray]:
    """Return the junction that each node is merged into, and which branches vanish inside one.

    Two streets that cross slightly askew meet in two junctions with a short link; they are merged.
    """
    gap = np.linalg.norm(places[node[:, 0], :2] - places[node[:, 1], :2], axis=1)
    room = places[node, 2].max(axis=1)
    short = (gap <= np.minimum(0.5 * room, room - GAPS.min_gap_m / 2)) & (shapely.length(branches) <= room)
    short &= (np.bincount(node.ravel(), minlength=len(places))[node] > 1).all(axis=1) & (node[:, 0] != node[:, 1])
    centre = np.arange(len(places))
    settled = np.zeros(len(places), bool)
    for index in np.flatnonzero(short)[np.argsort(-room[short], kind="stable")]:
        a, b = node[index][np.argsort(-places[node[index], 2], kind="stable")]
        if centre[a] == a and not settled[b]:
            centre[b] = a
            settled[[a, b]] = True
    return centre, short & (centre[node[:, 0]] == centre[node[:, 1]])


def _start_direction(path: Float64Array, distance: float) -> Float64Array:
    """Return the unit vector from the start of a path to its point at most `distance` metres on."""
    line = LineString(path)
    ahead = shapely.get_coordinates(line.interpolate(min(distance, line.length / 2)))[0] - path[0]
    direction: Float64Array = ahead / max(float(np.linalg.norm(ahead)), 1e-9)
    return direction


def _chain_paths(paths: list[Float64Array], ends: Int64Array, partner: Int64Array) -> list[LineString]:
    """Chain paths whose ends are partners into lines, open ones first, then rings.

    No line passes a junction twice: it is cut there into a ring and the way to it. ends (2 per path) are junctions;
    partner is the end that continues each end, -1 without.
    """
    partner = partner.copy()
    waiting = [*range(0, len(partner), 2), *np.flatnonzero(partner < 0)[::-1].tolist()]
    lines = []
    used = np.zeros(len(paths), bool)
    while waiting:
        end = waiting.pop()
        chain: list[Float64Array] = []
        passed = [ends[end]]
        while end >= 0 and not used[end // 2]:
            used[end // 2] = True
            chain.append(paths[end // 2][:: 1 - 2 * (end % 2)])
            end ^= 1
            following = int(partner[end])
            if ends[end] in passed:
                if following >= 0:
                    partner[[end, following]] = -1
                    waiting.append(following)
                start = passed.index(ends[end])
                lines += [_chain_line(part) for part in (chain[:start], chain[start:]) if part]
                chain = []
                break
            passed.append(ends[end])
            end = following
        if chain:
            lines.append(_chain_line(chain))
    return lines


def _chain_line(chain: Sequence[Float64Array]) -> LineString:
    coords = np.concatenate(chain)
    return LineString(coords[np.concatenate([[True], (np.diff(coords, axis=0) != 0).any(axis=1)])])


def _smooth_line(line: LineString, walls: shapely.STRtree) -> LineString:
    """Smooth a line over some metres with fixed ends, where it stays clear of walls and simple."""
    from scipy.ndimage import gaussian_filter1d

    steps = max(4, round(line.length))
    points = shapely.get_coordinates(shapely.line_interpolate_point(line, np.linspace(0.0, line.length, steps + 1)))
    for blur in GAPS.blurs_m:
        if line.is_closed:
            smooth = gaussian_filter1d(points[:-1], blur, axis=0, mode="wrap")
            smooth = np.concatenate([smooth, smooth[:1]])
        else:
            mirrored = np.concatenate([2 * points[0] - points[:0:-1], points, 2 * points[-1] - points[-2::-1]])
            smooth = gaussian_filter1d(mirrored, blur, axis=0)[steps : 2 * steps + 1]
        found = LineString(smooth).simplify(GAPS.simplification_m)
        if found.is_simple and len(walls.query(found, predicate="dwithin", distance=GAPS.min_clearance_m)) == 0:
            return found
    return line.simplify(GAPS.simplification_m)


def _diagonal_order(points: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Return sort keys of points from south-west to north-east."""
    return np.round(points[..., 0] + points[..., 1], 2), np.round(points[..., 0], 2)


def _orient_line(line: LineString) -> LineString:
    """Orient a line from its south-western end; a ring counter-clockwise from its south-western point."""
    coords = shapely.get_coordinates(line)
    if not line.is_closed:
        return line if _diagonal_order(coords[0]) <= _diagonal_order(coords[-1]) else line.reverse()
    ring = coords[:-1] if shapely.is_ccw(line) else coords[-2::-1]
    start = int(np.lexsort(_diagonal_order(ring)[::-1])[0])
    return LineString(np.concatenate([ring[start:], ring[: start + 1]]))
