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
from facade_core.geometry.buildings.settings import DORMERS
from facade_core.geometry.charts import ChartKind

# Range of metres between the middles of two dormers (WALL) or rooflights (WINDOW).
SPACING_M = {ChartKind.WALL: (3.4, 5.2), ChartKind.WINDOW: (4.0, 8.0)}

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
    eaves = [edge for edge in eaves if edge.slope > DORMERS.min_slope]
    if not eaves:
        return None
    chance, is_gabled = rng.random(), bool(rng.random() < DORMERS.gabled_share)
    ranges = (DORMERS.dormer_width_m, DORMERS.front_height_m, DORMERS.front_above_eaves_m)
    width, front_height, above_eaves = (low + rng.random() * (most - low) for low, most in ranges)
    shape = DormerShape(width, front_height, above_eaves, is_gabled)
    spacing = rng.random()
    blocked: BaseGeometry = shapely.GeometryCollection()
    if existing is not None:
        blocked = shapely.multipoints(existing.facets.vertices[:, :2]).convex_hull.buffer(0.4)
    faces, rows = RoofDetailBuilder(), 0
    for edge in cut_free_roof_edges(eaves, surroundings):
        kind = _opening_kind(edge.slope, chance)
        if kind is None or rows == DORMERS.max_rows:
            continue
        mine = roof.vertices[roof.triangles[roof.facet == edge.facet]]
        free = shapely.union_all(shapely.polygons(mine[..., :2])).buffer(-DORMERS.edge_clearance_m).difference(blocked)
        rise = float(mine[..., 2].max() - edge.start[2]) - DORMERS.ridge_clearance_m
        low, most = SPACING_M[kind]
        built = False
        for middle in _row_middles(edge, low + spacing * (most - low)):
            if kind == ChartKind.WINDOW:
                built |= _add_rooflight(
                    faces,
                    edge,
                    middle,
                    DORMERS.rooflight_above_eaves_m[0] + spacing * np.ptp(DORMERS.rooflight_above_eaves_m),
                    free,
                )
            else:
                built |= _add_dormer(faces, edge, middle, shape, rise, free)
        rows += built
    return faces.build() if rows else None


def _opening_kind(fall: float, chance: float) -> ChartKind | None:
    """Choose dormers (WALL), rooflights (WINDOW) or nothing for a roof of slope `fall`."""
    if fall > DORMERS.min_mansard_slope:
        return ChartKind.WALL if chance < DORMERS.mansard_dormer_share else None
    if chance < DORMERS.dormer_share:
        return ChartKind.WALL if fall > DORMERS.min_dormer_slope else None
    return ChartKind.WINDOW if chance < DORMERS.dormer_share + DORMERS.rooflight_share else None


def _row_middles(edge: RoofEdge, step: float) -> Float64Array:
    """Return the middles of a centred row along an edge in metres."""
    room = float(np.hypot(*(edge.end - edge.start)[:2])) - 2 * DORMERS.end_distance_m
    count = min(int(max(room, -1.0) / step) + 1, DORMERS.max_per_row) if room > 0 else 0
    return np.asarray(DORMERS.end_distance_m + room / 2 + step * (np.arange(count) - (count - 1) / 2), np.float64)


def _roof_points(edge: RoofEdge) -> RoofPoint:
    """Return a function from metres along an edge, behind it and above it to world points."""
    origin, ahead, out = edge.start, np.append(edge.direction, 0.0), np.append(edge.outward, 0.0)

    def at(along: float, behind: float, over: float) -> Float64Array:
        return origin + along * ahead - behind * out + over * np.array([0.0, 0.0, 1.0])

    return at


def _add_dormer(
    faces: RoofDetailBuilder, edge: RoofEdge, middle: float, shape: DormerShape, rise: float, free: BaseGeometry
) -> bool:
    """Add a dormer with its front around `middle` metres along an edge.

    False where it has no room below `rise` metres and, seen from above, within `free`.
    """
    fall, at = edge.slope, _roof_points(edge)
    front = max(shape.above_eaves / fall, DORMERS.min_setback_m)
    foot, gable = front * fall, DORMERS.gable_height_m if shape.is_gabled else 0.0
    # the upper end meets the roof: the ridge of a gable is level, a shed roof rises to the back
    slope = 0.0 if shape.is_gabled else min(DORMERS.shed_slope, fall / 4)
    top = min(foot + shape.front_height, rise - gable)
    back = (top + gable - slope * front) / (fall - slope)
    if not shape.is_gabled and back * fall > rise:
        back = rise / fall
        top = rise - slope * (back - front)
    if top - foot < DORMERS.min_front_height_m:
        return False
    left, right = middle - shape.width / 2, middle + shape.width / 2
    ground = Polygon(
        [at(*place)[:2] for place in ((left, front, 0), (right, front, 0), (right, back, 0), (left, back, 0))]
    )
    if not free.contains(ground):
        return False
    low = foot - DORMERS.buried_m
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
    sides, ahead = (left + DORMERS.jamb_m, right - DORMERS.jamb_m), front - DORMERS.window_relief_m
    sill, head = foot + DORMERS.sill_m, top - DORMERS.head_m
    faces.add_polygon(
        ChartKind.WINDOW,
        [at(sides[0], ahead, sill), at(sides[1], ahead, sill), at(sides[1], ahead, head), at(sides[0], ahead, head)],
    )
    return True


def _add_rooflight(faces: RoofDetailBuilder, edge: RoofEdge, middle: float, over: float, free: BaseGeometry) -> bool:
    """Add a rooflight over an edge; False where it has no room within `free`, seen from above."""
    fall, at = edge.slope, _roof_points(edge)
    low = max(over / fall, DORMERS.min_setback_m)
    up = low + DORMERS.rooflight_size_m[1] / np.hypot(1.0, fall)
    left, right = middle - DORMERS.rooflight_size_m[0] / 2, middle + DORMERS.rooflight_size_m[0] / 2
    corners = ((left, low), (right, low), (right, up), (left, up))
    if not free.contains(Polygon([at(along, behind, 0)[:2] for along, behind in corners])):
        return False
    faces.add_polygon(
        ChartKind.WINDOW, [at(along, behind, behind * fall + DORMERS.window_relief_m) for along, behind in corners]
    )
    return True
