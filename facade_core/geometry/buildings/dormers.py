"""Dormers and rooflights on roofs of assumed shape: rows over eaves in sight of a street, random by the building's id."""

from __future__ import annotations

from collections.abc import Callable
from hashlib import blake2b
from typing import NamedTuple

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from facade_core.core.arrays import Float64Array
from facade_core.geometry.buildings.facets import Facets
from facade_core.geometry.buildings.roof_details import RoofDetail, RoofDetailBuilder
from facade_core.geometry.buildings.roof_edges import RoofEdge, RoofSurroundings, cut_free_roof_edges, roof_edges
from facade_core.geometry.charts import ChartKind

# Slopes (rise over run) from which roofs have rooflights and dormers, and from which they are lower parts of mansards.
MIN_SLOPE = 0.25
MIN_DORMER_SLOPE = 0.45
MIN_MANSARD_SLOPE = 1.2
# Shares of roofs with dormers and with rooflights, and of mansards with dormers.
DORMER_SHARE = 0.35
ROOFLIGHT_SHARE = 0.3
MANSARD_DORMER_SHARE = 0.9
MAX_PER_ROW = 8
# Rows per building.
MAX_ROWS = 5
# Range of metres between the middles of two dormers (WALL) or rooflights (WINDOW).
SPACING_M = {ChartKind.WALL: (3.4, 5.2), ChartKind.WINDOW: (4.0, 8.0)}
# Metres from the end of the eaves to the middle of a row's first.
END_DISTANCE_M = 1.2
# Ranges in metres: width, height of the front, and height of its foot over the eaves.
DORMER_WIDTH_M = (1.1, 1.5)
FRONT_HEIGHT_M = (1.2, 1.5)
FRONT_ABOVE_EAVES_M = (0.35, 0.6)
MIN_FRONT_HEIGHT_M = 1.0
# Metres from the eaves back to the front.
MIN_SETBACK_M = 0.2
# Share of buildings whose dormers have gables, and the height of a gable in metres.
GABLED_SHARE = 0.5
GABLE_HEIGHT_M = 0.45
# Slope of the roof of a dormer without a gable, down to the front.
SHED_SLOPE = 0.08
# Metres to the edges of the roof facet, and to its upper end.
EDGE_CLEARANCE_M = 0.05
RIDGE_CLEARANCE_M = 0.15
# Metres from a dormer's window to the sides, the foot and the top of the front, and out of it.
JAMB_M = 0.13
SILL_M = 0.16
HEAD_M = 0.12
WINDOW_RELIEF_M = 0.03
# Metres from the roof down to the foot of a dormer.
BURIED_M = 0.04
# Width of a rooflight and its height along the slope, metres.
ROOFLIGHT_SIZE_M = (0.78, 1.18)
# Range of metres from the eaves up to the lower edge of a rooflight.
ROOFLIGHT_ABOVE_EAVES_M = (1.0, 1.6)

# Metres along an edge, behind it and above it -> world point (3,).
RoofPoint = Callable[[float, float, float], Float64Array]


class DormerShape(NamedTuple):
    """Shape of the dormers of a building: width, height of the front, its foot over the eaves, metres; with gables or not."""

    width: float
    front_height: float
    above_eaves: float
    is_gabled: bool


def build_dormers(
    id: str, roof: Facets, outline: Polygon, surroundings: RoofSurroundings, existing: RoofDetail | None
) -> RoofDetail | None:
    """Build the dormers or the rooflights of a building.

    A dormer has at most 11 triangles, a rooflight 2.

    Parameters
    ----------
    id : seed of the random draws.
    roof : facets of the roof.
    outline : footprint of the building.
    surroundings : surroundings of the roof's edges.
    existing : details that are on the roof already.

    Returns
    -------
    None without any.
    """
    rng = np.random.default_rng(
        int.from_bytes(blake2b(id.encode(errors="surrogatepass"), digest_size=8, person=b"dormers").digest())
    )
    eaves = [edge for edge in roof_edges(roof, outline) if abs(edge.end[2] - edge.start[2]) < 0.02]
    eaves = [edge for edge in eaves if edge.slope > MIN_SLOPE]
    if not eaves:
        return None
    chance, is_gabled = rng.random(), bool(rng.random() < GABLED_SHARE)
    ranges = (DORMER_WIDTH_M, FRONT_HEIGHT_M, FRONT_ABOVE_EAVES_M)
    width, front_height, above_eaves = (low + rng.random() * (most - low) for low, most in ranges)
    shape = DormerShape(width, front_height, above_eaves, is_gabled)
    spacing = rng.random()
    blocked: BaseGeometry = shapely.GeometryCollection()
    if existing is not None:
        blocked = shapely.multipoints(existing.facets.vertices[:, :2]).convex_hull.buffer(0.4)
    faces, rows = RoofDetailBuilder(), 0
    for edge in cut_free_roof_edges(eaves, surroundings):
        kind = _opening_kind(edge.slope, chance)
        if kind is None or rows == MAX_ROWS:
            continue
        mine = roof.vertices[roof.triangles[roof.facet == edge.facet]]
        free = shapely.union_all(shapely.polygons(mine[..., :2])).buffer(-EDGE_CLEARANCE_M).difference(blocked)
        rise = float(mine[..., 2].max() - edge.start[2]) - RIDGE_CLEARANCE_M
        low, most = SPACING_M[kind]
        built = False
        for middle in _row_middles(edge, low + spacing * (most - low)):
            if kind == ChartKind.WINDOW:
                built |= _add_rooflight(
                    faces, edge, middle, ROOFLIGHT_ABOVE_EAVES_M[0] + spacing * np.ptp(ROOFLIGHT_ABOVE_EAVES_M), free
                )
            else:
                built |= _add_dormer(faces, edge, middle, shape, rise, free)
        rows += built
    return faces.build() if rows else None


def _opening_kind(fall: float, chance: float) -> ChartKind | None:
    """Choose dormers (WALL), rooflights (WINDOW) or nothing for a roof of slope `fall`."""
    if fall > MIN_MANSARD_SLOPE:
        return ChartKind.WALL if chance < MANSARD_DORMER_SHARE else None
    if chance < DORMER_SHARE:
        return ChartKind.WALL if fall > MIN_DORMER_SLOPE else None
    return ChartKind.WINDOW if chance < DORMER_SHARE + ROOFLIGHT_SHARE else None


def _row_middles(edge: RoofEdge, step: float) -> Float64Array:
    """Return the middles of a centred row along an edge in metres."""
    room = float(np.hypot(*(edge.end - edge.start)[:2])) - 2 * END_DISTANCE_M
    count = min(int(max(room, -1.0) / step) + 1, MAX_PER_ROW) if room > 0 else 0
    return np.asarray(END_DISTANCE_M + room / 2 + step * (np.arange(count) - (count - 1) / 2), np.float64)


def _roof_points(edge: RoofEdge) -> RoofPoint:
    """Return a function from metres along an edge, behind it and above it to world points."""
    origin, ahead, out = edge.start, np.append(edge.direction, 0.0), np.append(edge.outward, 0.0)

    def at(along: float, behind: float, over: float) -> Float64Array:
        return origin + along * ahead - behind * out + over * np.array([0.0, 0.0, 1.0])

    return at


def _add_dormer(
    faces: RoofDetailBuilder,
    edge: RoofEdge,
    middle: float,
    shape: DormerShape,
    rise: float,
    free: BaseGeometry,
) -> bool:
    """Add a dormer with its front around `middle` metres along an edge.

    False where it has no room below `rise` metres and, seen from above, within `free`.
    """
    fall, at = edge.slope, _roof_points(edge)
    front = max(shape.above_eaves / fall, MIN_SETBACK_M)
    foot, gable = front * fall, GABLE_HEIGHT_M if shape.is_gabled else 0.0
    # the upper end meets the roof: the ridge of a gable is level, a shed roof rises to the back
    slope = 0.0 if shape.is_gabled else min(SHED_SLOPE, fall / 4)
    top = min(foot + shape.front_height, rise - gable)
    back = (top + gable - slope * front) / (fall - slope)
    if not shape.is_gabled and back * fall > rise:
        back = rise / fall
        top = rise - slope * (back - front)
    if top - foot < MIN_FRONT_HEIGHT_M:
        return False
    left, right = middle - shape.width / 2, middle + shape.width / 2
    ground = Polygon(
        [at(*place)[:2] for place in ((left, front, 0), (right, front, 0), (right, back, 0), (left, back, 0))]
    )
    if not free.contains(ground):
        return False
    low = foot - BURIED_M
    level = top / fall if shape.is_gabled else back
    end = top if shape.is_gabled else back * fall
    face = [at(left, front, low), at(right, front, low), at(right, front, top), at(left, front, top)]
    out = np.append(edge.outward, 0.0)
    if shape.is_gabled:
        apex, ridge = at(middle, front, top + gable), at(middle, back, top + gable)
        face.insert(3, apex)
        faces.add_polygon(ChartKind.ROOF, [at(right, front, top), at(right, level, top), ridge, apex])
        faces.add_polygon(ChartKind.ROOF, [at(left, level, top), at(left, front, top), apex, ridge])
    else:
        faces.add_polygon(
            ChartKind.ROOF, [at(left, front, top), at(right, front, top), at(right, back, end), at(left, back, end)]
        )
    faces.add_polygon(ChartKind.WALL, face)
    faces.add_polygon(ChartKind.WALL, [at(left, level, end), at(left, front, low), at(left, front, top)], along=out)
    faces.add_polygon(ChartKind.WALL, [at(right, front, low), at(right, level, end), at(right, front, top)], along=-out)
    sides, ahead = (left + JAMB_M, right - JAMB_M), front - WINDOW_RELIEF_M
    sill, head = foot + SILL_M, top - HEAD_M
    faces.add_polygon(
        ChartKind.WINDOW,
        [at(sides[0], ahead, sill), at(sides[1], ahead, sill), at(sides[1], ahead, head), at(sides[0], ahead, head)],
    )
    return True


def _add_rooflight(faces: RoofDetailBuilder, edge: RoofEdge, middle: float, over: float, free: BaseGeometry) -> bool:
    """Add a rooflight over an edge; False where it has no room within `free`, seen from above."""
    fall, at = edge.slope, _roof_points(edge)
    low = max(over / fall, MIN_SETBACK_M)
    up = low + ROOFLIGHT_SIZE_M[1] / np.hypot(1.0, fall)
    left, right = middle - ROOFLIGHT_SIZE_M[0] / 2, middle + ROOFLIGHT_SIZE_M[0] / 2
    corners = ((left, low), (right, low), (right, up), (left, up))
    if not free.contains(Polygon([at(along, behind, 0)[:2] for along, behind in corners])):
        return False
    faces.add_polygon(
        ChartKind.WINDOW, [at(along, behind, behind * fall + WINDOW_RELIEF_M) for along, behind in corners]
    )
    return True
