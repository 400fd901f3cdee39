"""Dormers and rooflights on roofs whose shape is assumed: in rows over eaves that a street sees, where the building's id puts
them."""

from __future__ import annotations

from collections.abc import Callable
from hashlib import blake2b

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from facade_core.geometry.buildings.facets import Facets
from facade_core.geometry.buildings.roof_details import Faces, Trim
from facade_core.geometry.buildings.roof_edges import Around, Edge, free_pieces, roof_edges
from facade_core.geometry.charts import ChartKind

# Of the roofs that are steep enough (metres a metre) these shares have dormers and rooflights; of the lower part of mansards
# the third has dormers. Flatter than the last figure a roof has neither.
STEEP, MANSARD, FLAT = 0.45, 1.2, 0.25
DORMERS, ROOFLIGHTS, ON_MANSARDS = 0.35, 0.3, 0.9
# No row has more, no house more than so many rows.
MOST, ROWS = 8, 5
# From the middle of one to that of the next, and from the end of the eaves.
STEP_M, ASIDE_M = {ChartKind.WALL: (3.4, 5.2), ChartKind.WINDOW: (4.0, 8.0)}, 1.2
# A dormer's width, the height of its front, at least the second figure, and where that begins over the eaves and behind them.
WIDE_M, HIGH_M, LEAST_HIGH_M, OVER_M, BEHIND_M = (1.1, 1.5), (1.2, 1.5), 1.0, (0.35, 0.6), 0.2
# Half of the houses have gables on them, so high; the roofs of other dormers fall by so much a metre, to the front.
GABLED, GABLE_M, FALL = 0.5, 0.45, 0.08
# Nothing comes nearer to an edge of the roof's facet, or to its upper end.
CLEAR_M, BELOW_RIDGE_M = 0.05, 0.15
# Its window: so far from the sides, over the foot, under the top, and out of the front. It begins so far below the roof.
JAMB_M, SILL_M, HEAD_M, OUT_M, SUNK_M = 0.13, 0.16, 0.12, 0.03, 0.04
# A rooflight's width, its height along the slope, and how far over the eaves its lower edge is.
LIGHT_M, LIGHT_OVER_M = (0.78, 1.18), (1.0, 1.6)

Place = Callable[[float, float, float], np.ndarray]


def dormers(id: str, roof: Facets, outline: Polygon, around: Around, taken: Trim | None) -> Trim | None:
    """The dormers or the rooflights of a building on the facets of its roof; None where it has none.

    taken: what stands on the roof already. A dormer has at most 11 triangles, a rooflight 2.
    """
    rng = np.random.default_rng(
        int.from_bytes(blake2b(id.encode(errors="surrogatepass"), digest_size=8, person=b"dormers").digest())
    )
    eaves = [edge for edge in roof_edges(roof, outline) if abs(edge.end[2] - edge.start[2]) < 0.02]
    eaves = [edge for edge in eaves if edge.fall > FLAT]
    if not eaves:
        return None
    chance, gabled = rng.random(), bool(rng.random() < GABLED)
    wide, high, over = (low + rng.random() * (most - low) for low, most in (WIDE_M, HIGH_M, OVER_M))
    spacing = rng.random()
    blocked: BaseGeometry = shapely.GeometryCollection()
    if taken is not None:
        blocked = shapely.multipoints(taken.facets.vertices[:, :2]).convex_hull.buffer(0.4)
    faces, rows = Faces(), 0
    for edge in free_pieces(eaves, around):
        kind = _kind(edge.fall, chance)
        if kind is None or rows == ROWS:
            continue
        mine = roof.vertices[roof.triangles[roof.facet == edge.facet]]
        free = shapely.union_all(shapely.polygons(mine[..., :2])).buffer(-CLEAR_M).difference(blocked)
        rise = float(mine[..., 2].max() - edge.start[2]) - BELOW_RIDGE_M
        low, most = STEP_M[kind]
        built = False
        for middle in _middles(edge, low + spacing * (most - low)):
            if kind == ChartKind.WINDOW:
                built |= _light(faces, edge, middle, LIGHT_OVER_M[0] + spacing * np.ptp(LIGHT_OVER_M), free)
            else:
                built |= _dormer(faces, edge, middle, wide, high, over, rise, gabled, free)
        rows += built
    return faces.trim() if rows else None


def _kind(fall: float, chance: float) -> ChartKind | None:
    """What a roof that falls so much a metre has: dormers (WALL), rooflights (WINDOW), nothing."""
    if fall > MANSARD:
        return ChartKind.WALL if chance < ON_MANSARDS else None
    if chance < DORMERS:
        return ChartKind.WALL if fall > STEEP else None
    return ChartKind.WINDOW if chance < DORMERS + ROOFLIGHTS else None


def _middles(edge: Edge, step: float) -> np.ndarray:
    """Where along an edge the middles of a row are, metres: in the same distance from both of its ends."""
    room = float(np.hypot(*(edge.end - edge.start)[:2])) - 2 * ASIDE_M
    count = min(int(max(room, -1.0) / step) + 1, MOST) if room > 0 else 0
    return ASIDE_M + room / 2 + step * (np.arange(count) - (count - 1) / 2)


def _from(edge: Edge) -> Place:
    """World points by metres along an edge, behind it and over it."""
    origin, ahead, out = edge.start, np.append(edge.ahead, 0.0), np.append(edge.out, 0.0)

    def at(along: float, behind: float, over: float) -> np.ndarray:
        return origin + along * ahead - behind * out + over * np.array([0.0, 0.0, 1.0])

    return at


def _dormer(
    faces: Faces,
    edge: Edge,
    middle: float,
    wide: float,
    high: float,
    over: float,
    rise: float,
    gabled: bool,
    free: BaseGeometry,
) -> bool:
    """Put a dormer on the roof over an edge, the middle of its front so far along; False where there is no room for it, neither
    below `rise` metres nor within `free`, from above."""
    fall, at = edge.fall, _from(edge)
    front = max(over / fall, BEHIND_M)
    foot, gable = front * fall, GABLE_M if gabled else 0.0
    # its upper end lies on the roof: a gable's is level, another's rises to the back
    slope = 0.0 if gabled else min(FALL, fall / 4)
    top = min(foot + high, rise - gable)
    back = (top + gable - slope * front) / (fall - slope)
    if not gabled and back * fall > rise:
        back = rise / fall
        top = rise - slope * (back - front)
    if top - foot < LEAST_HIGH_M:
        return False
    left, right = middle - wide / 2, middle + wide / 2
    ground = Polygon(
        [at(*place)[:2] for place in ((left, front, 0), (right, front, 0), (right, back, 0), (left, back, 0))]
    )
    if not free.contains(ground):
        return False
    low = foot - SUNK_M
    level = top / fall if gabled else back
    end = top if gabled else back * fall
    face = [at(left, front, low), at(right, front, low), at(right, front, top), at(left, front, top)]
    out = np.append(edge.out, 0.0)
    if gabled:
        apex, ridge = at(middle, front, top + gable), at(middle, back, top + gable)
        face.insert(3, apex)
        faces.add(ChartKind.ROOF, [at(right, front, top), at(right, level, top), ridge, apex])
        faces.add(ChartKind.ROOF, [at(left, level, top), at(left, front, top), apex, ridge])
    else:
        faces.add(
            ChartKind.ROOF, [at(left, front, top), at(right, front, top), at(right, back, end), at(left, back, end)]
        )
    faces.add(ChartKind.WALL, face)
    faces.add(ChartKind.WALL, [at(left, level, end), at(left, front, low), at(left, front, top)], along=out)
    faces.add(ChartKind.WALL, [at(right, front, low), at(right, level, end), at(right, front, top)], along=-out)
    sides, ahead = (left + JAMB_M, right - JAMB_M), front - OUT_M
    sill, head = foot + SILL_M, top - HEAD_M
    faces.add(
        ChartKind.WINDOW,
        [at(sides[0], ahead, sill), at(sides[1], ahead, sill), at(sides[1], ahead, head), at(sides[0], ahead, head)],
    )
    return True


def _light(faces: Faces, edge: Edge, middle: float, over: float, free: BaseGeometry) -> bool:
    """Put a rooflight on the roof over an edge; False where there is no room for it within `free`, from above."""
    fall, at = edge.fall, _from(edge)
    low = max(over / fall, BEHIND_M)
    up = low + LIGHT_M[1] / np.hypot(1.0, fall)
    left, right = middle - LIGHT_M[0] / 2, middle + LIGHT_M[0] / 2
    corners = ((left, low), (right, low), (right, up), (left, up))
    if not free.contains(Polygon([at(along, behind, 0)[:2] for along, behind in corners])):
        return False
    faces.add(ChartKind.WINDOW, [at(along, behind, behind * fall + OUT_M) for along, behind in corners])
    return True
