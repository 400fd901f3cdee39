"""Street centrelines where none are given: the medial axis of the gaps between buildings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from facade_core.core.errors import GeometryError
from facade_core.core.types import Street

_ORIGIN = 1000.0  # m
NARROWEST = 2.5  # m; through a narrower gap no camera travels
PLACE = 10_000.0  # m2; a place that buildings enclose wholly is a yard below, a square with built-over entrances above
CLEARANCE = 1.0  # m; no street comes nearer to a building
_SAMPLING = 1.0  # m between the points of an outline that carry the Voronoi diagram
_TILE = 500.0  # m; bounds the memory that a city takes
_SPUR = 1.5  # a blind branch shorter than this many clearances of its junction leads into a corner
_WEDGE = (
    0.4  # gain of clearance per metre from the tip of a blind branch that marks a corner: 47 degrees between its walls
)
_STRAIGHT = np.cos(np.radians(50.0))  # a street goes on through a junction where it turns by less
_BLURS = (3.0, 1.0)  # m; the first that keeps clear of the walls smooths a street
_DETAIL = 0.1  # m; what a simplified line may miss
_SHORTEST = 5.0  # m; what junctions leave over


def streets_between(footprints: Sequence[Polygon], *, reach: float = 15.0) -> tuple[Street, ...]:
    """Streets along the gaps between buildings, ordered from south-west to north-east, named g0, g1, ...

    footprints: valid polygons in metres; they may touch and overlap. The streets follow the medial axis of the free space
    within `reach` metres of a building: the middle of gaps up to about 2 x reach wide, else half of `reach` before the walls,
    so that a building alone has a ring around it. Gaps narrower than NARROWEST carry none, nor do yards: free space smaller
    than PLACE without a gap to the outside that is NARROWEST wide. No street comes nearer to a building than CLEARANCE. Lines
    are smoothed over some metres. The result does not depend on the order of the footprints.

    Raises GeometryError where a footprint has coordinates that are not finite, or `reach` is not above NARROWEST.
    """
    if not reach > NARROWEST:
        raise GeometryError(
            f"reach {reach:g} m leaves no street between walls and its border; give more than {NARROWEST:g}"
        )
    for index, footprint in enumerate(footprints):
        if not np.isfinite(shapely.get_coordinates(footprint)).all():
            raise GeometryError(f"footprint {index} has coordinates that are not finite; repair or remove it")
    outlines = np.array([footprint for footprint in footprints if not footprint.is_empty], dtype=object)
    if len(outlines) == 0:
        return ()
    bounds = shapely.bounds(outlines)
    # Qhull squares coordinates: near the origin none of their digits are lost. On a grid, so that streets stay as they are when
    # something is built elsewhere.
    corner = np.floor(bounds[:, :2].min(axis=0) / _ORIGIN) * _ORIGIN
    outlines = shapely.transform(outlines[np.lexsort(bounds.T)], lambda xy: xy - corner)

    solid = _solid(outlines)
    open_strip = reach / 5  # gaps this much wider than twice the reach still have one street, not one along each side
    zone = _zone(solid, reach, open_strip)
    branches = _pruned(_medial_axis(solid, zone, widest=reach + open_strip))
    walls = shapely.STRtree(outlines)
    lines = [_directed(_smoothed(line, walls)) for line in _through_junctions(branches) if line.length >= _SHORTEST]
    lines.sort(key=lambda line: (*_diagonal(np.array(line.coords[0])), line.length))
    return tuple(
        Street(f"g{index}", None, shapely.transform(line, lambda xy: np.round(xy + corner, 3)))
        for index, line in enumerate(lines)
    )


def _solid(outlines: np.ndarray) -> BaseGeometry:
    """The ground that no street crosses: buildings, the gaps that are too narrow, and yards."""
    grown = shapely.union_all(shapely.buffer(outlines, NARROWEST / 2, quad_segs=4))
    filled = shapely.union_all([_without_holes(part, below=PLACE) for part in shapely.get_parts(grown)])
    return shapely.buffer(filled, -NARROWEST / 2, quad_segs=4)


def _zone(solid: BaseGeometry, reach: float, strip: float) -> BaseGeometry:
    """All ground within reach of a building, and what that leaves open in strips narrower than 2 x `strip`."""
    parts = shapely.buffer(shapely.get_parts(solid), reach + strip, quad_segs=8)
    return shapely.buffer(shapely.union_all(parts), -strip, quad_segs=8)


def _without_holes(polygon: Polygon, *, below: float) -> Polygon:
    return Polygon(polygon.exterior, [hole for hole in polygon.interiors if Polygon(hole).area >= below])


def _medial_axis(solid: BaseGeometry, zone: BaseGeometry, *, widest: float) -> np.ndarray:
    """Lines, their z the clearance, of the medial axis of the zone less the solid, in which no clearance is above `widest`.

    They are the Voronoi edges between points of its outline that are opposite each other, found tile by tile: no point
    that is farther than twice the widest clearance has a part in an edge.
    """
    free = shapely.difference(zone, solid)
    points = np.unique(np.round(shapely.get_coordinates(shapely.segmentize(free, _SAMPLING)), 3), axis=0)
    shapely.prepare(free)
    found = []
    for west in np.arange(points[0, 0], points[-1, 0] + _TILE, _TILE):
        first, last = np.searchsorted(points[:, 0], [west - 2 * widest, west + _TILE + 2 * widest])
        column = points[first:last]
        column = column[np.argsort(column[:, 1], kind="stable")]
        for south in np.arange(points[:, 1].min(), points[:, 1].max() + _TILE, _TILE):
            first, last = np.searchsorted(column[:, 1], [south - 2 * widest, south + _TILE + 2 * widest])
            if last - first > 4:
                edges = _opposite_edges(column[first:last], free)
                middle = edges[..., :2].mean(axis=1)
                inside = ((middle >= (west, south)) & (middle < (west + _TILE, south + _TILE))).all(axis=1)
                found.append(_merged(shapely.linestrings(edges[inside])))
    return _merged(np.concatenate(found))


def _opposite_edges(points: np.ndarray, free: BaseGeometry) -> np.ndarray:
    """Voronoi edges (e, 2, 3), z the clearance, inside `free` between points that a camera fits between."""
    from scipy.spatial import Voronoi

    diagram = Voronoi(points)
    ends, between = np.asarray(diagram.ridge_vertices), diagram.ridge_points
    keep = (ends >= 0).all(axis=1) & (np.linalg.norm(np.diff(points[between], axis=1)[:, 0], axis=1) >= NARROWEST)
    ends, between = ends[keep], between[keep]
    # Two tiles must agree on a vertex, and vertices between points in whole millimetres often lie on half ones.
    vertices = np.round(diagram.vertices + 2e-4, 3)
    clearance = np.zeros(len(vertices))
    clearance[ends] = np.linalg.norm(vertices[ends] - points[between[:, :1]], axis=2)
    inside = clearance >= NARROWEST / 2
    inside[inside] = shapely.contains_xy(free, vertices[inside])
    ends = ends[inside[ends].all(axis=1)]
    ends = ends[(vertices[ends[:, 0]] != vertices[ends[:, 1]]).any(axis=1)]
    return np.column_stack([vertices, clearance])[ends]


def _merged(pieces: np.ndarray) -> np.ndarray:
    """Pieces joined wherever exactly two meet."""
    return shapely.get_parts(shapely.line_merge(shapely.multilinestrings(pieces)))


def _nodes(branches: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places (n, 3) where branches end, z the clearance, and which of them each branch starts and ends at, (b, 2)."""
    ends = np.stack([shapely.get_coordinates(shapely.get_point(branches, k), include_z=True) for k in (0, -1)], axis=1)
    _, first, node = np.unique(ends.reshape(-1, 3)[:, :2], axis=0, return_index=True, return_inverse=True)
    return ends.reshape(-1, 3)[first], node.reshape(-1, 2)


def _pruned(branches: np.ndarray) -> np.ndarray:
    """Branches without those that lead into corners only; what stays of a blind one ends where its corner begins."""
    while True:
        places, node = _nodes(branches)
        blind = np.bincount(node.ravel(), minlength=len(places))[node] == 1
        spur = np.zeros(len(branches), bool)
        for index in np.flatnonzero(blind[:, 0] != blind[:, 1]):
            coords = shapely.get_coordinates(branches[index], include_z=True)
            rest = _without_wedge(coords if blind[index, 0] else coords[::-1])
            spur[index] = _length(rest) < _SPUR * rest[-1, 2]
        if not spur.any():
            break
        branches = _merged(branches[~spur])
    for index in np.flatnonzero(blind.any(axis=1)):
        coords = shapely.get_coordinates(branches[index], include_z=True)
        coords = _without_wedge(coords) if blind[index, 0] else coords
        coords = _without_wedge(coords[::-1])[::-1] if blind[index, 1] else coords
        branches[index] = LineString(coords)
    return branches


def _without_wedge(coords: np.ndarray) -> np.ndarray:
    """A branch (n, 3) from its blind tip on, without the part where the walls still diverge from a corner."""
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(coords[:, :2], axis=0), axis=1))])
    level = coords[:, 2] - coords[0, 2] < _WEDGE * travelled - 0.1  # 0.1: the zigzag of the sampling
    start = int(np.argmax(level)) if level.any() else len(coords) - 1
    return coords[min(max(start - 1, 0), len(coords) - 2) :]


def _length(coords: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(coords[:, :2], axis=0), axis=1).sum())


def _through_junctions(branches: np.ndarray) -> list[LineString]:
    """Branches joined to long lines: at each junction the pair of them that goes on straightest, then the next."""
    places, node = _nodes(branches)
    centre, link = _junctions(branches, places, node)
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
        away = np.array([_heading(paths[e // 2][:: 1 - 2 * (e % 2)], places[ends[e], 2] + 5.0) for e in group])
        cosine = -away @ away.T
        rows, columns = np.triu_indices(len(group), 1)
        for k in np.argsort(-np.round(cosine[rows, columns], 6), kind="stable"):
            one, other = group[rows[k]], group[columns[k]]
            if cosine[rows[k], columns[k]] >= _STRAIGHT and partner[one] < 0 and partner[other] < 0:
                partner[one], partner[other] = other, one
    return _chained(paths, ends, partner)


def _junctions(branches: np.ndarray, places: np.ndarray, node: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The widest junction that each place is drawn into, itself mostly, and which branches vanish inside of one.

    Two streets that cross a little askew meet in two junctions with a short link; they shall cross in one.
    """
    gap = np.linalg.norm(places[node[:, 0], :2] - places[node[:, 1], :2], axis=1)
    room = places[node, 2].max(axis=1)
    short = (gap <= np.minimum(0.5 * room, room - NARROWEST / 2)) & (shapely.length(branches) <= room)
    short &= (np.bincount(node.ravel(), minlength=len(places))[node] > 1).all(axis=1) & (node[:, 0] != node[:, 1])
    centre = np.arange(len(places))
    settled = np.zeros(len(places), bool)
    for index in np.flatnonzero(short)[np.argsort(-room[short], kind="stable")]:
        a, b = node[index][np.argsort(-places[node[index], 2], kind="stable")]
        if centre[a] == a and not settled[b]:
            centre[b] = a
            settled[[a, b]] = True
    return centre, short & (centre[node[:, 0]] == centre[node[:, 1]])


def _heading(path: np.ndarray, distance: float) -> np.ndarray:
    """Unit vector from the start of a path to its point at most `distance` metres on."""
    line = LineString(path)
    ahead = shapely.get_coordinates(line.interpolate(min(distance, line.length / 2)))[0] - path[0]
    return ahead / max(float(np.linalg.norm(ahead)), 1e-9)


def _chained(paths: list[np.ndarray], ends: np.ndarray, partner: np.ndarray) -> list[LineString]:
    """Lines along paths whose ends are partners, first those that begin somewhere, then rings.

    None passes a junction twice: what comes back to one is cut there into a ring and the way to it.
    ends: the junction at each path's start and end (2 per path); partner: the end that each goes on with, -1 for none.
    """
    partner = partner.copy()
    waiting = [*range(0, len(partner), 2), *np.flatnonzero(partner < 0)[::-1].tolist()]
    lines = []
    used = np.zeros(len(paths), bool)
    while waiting:
        end = waiting.pop()
        chain: list[np.ndarray] = []
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
                lines += [_line(part) for part in (chain[:start], chain[start:]) if part]
                chain = []
                break
            passed.append(ends[end])
            end = following
        if chain:
            lines.append(_line(chain))
    return lines


def _line(chain: Sequence[np.ndarray]) -> LineString:
    coords = np.concatenate(chain)
    return LineString(coords[np.concatenate([[True], (np.diff(coords, axis=0) != 0).any(axis=1)])])


def _smoothed(line: LineString, walls: shapely.STRtree) -> LineString:
    """Smoothed over some metres, its ends kept, as far as that leads neither near to a wall nor across itself."""
    from scipy.ndimage import gaussian_filter1d

    steps = max(4, round(line.length))
    points = shapely.get_coordinates(shapely.line_interpolate_point(line, np.linspace(0.0, line.length, steps + 1)))
    for blur in _BLURS:
        if line.is_closed:
            smooth = gaussian_filter1d(points[:-1], blur, axis=0, mode="wrap")
            smooth = np.concatenate([smooth, smooth[:1]])
        else:
            mirrored = np.concatenate([2 * points[0] - points[:0:-1], points, 2 * points[-1] - points[-2::-1]])
            smooth = gaussian_filter1d(mirrored, blur, axis=0)[steps : 2 * steps + 1]
        found = LineString(smooth).simplify(_DETAIL)
        if found.is_simple and len(walls.query(found, predicate="dwithin", distance=CLEARANCE)) == 0:
            return found
    return line.simplify(_DETAIL)


def _diagonal(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What orders points from south-west to north-east."""
    return np.round(points[..., 0] + points[..., 1], 2), np.round(points[..., 0], 2)


def _directed(line: LineString) -> LineString:
    """From its more south-western end on; a ring counter-clockwise from its most south-western point."""
    coords = shapely.get_coordinates(line)
    if not line.is_closed:
        return line if _diagonal(coords[0]) <= _diagonal(coords[-1]) else line.reverse()
    ring = coords[:-1] if shapely.is_ccw(line) else coords[-2::-1]
    start = int(np.lexsort(_diagonal(ring)[::-1])[0])
    return LineString(np.concatenate([ring[start:], ring[: start + 1]]))
