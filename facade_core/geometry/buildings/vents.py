"""Vents on roofs of assumed shape in sight of a street: cowls on slopes, boxes on flat roofs."""

from __future__ import annotations

from hashlib import blake2b
from typing import NamedTuple

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from facade_core.core.arrays import Float64Array
from facade_core.core.fixed_order import multiply_matrices
from facade_core.geometry.buildings.facets import Facets
from facade_core.geometry.buildings.roof_details import RoofDetail, RoofDetailBuilder
from facade_core.geometry.buildings.roof_edges import RoofEdge, RoofSurroundings, cut_free_roof_edges, roof_edges
from facade_core.geometry.buildings.settings import EAVES, ROOF_EDGES, VENTS
from facade_core.geometry.charts import ChartKind


class VentShape(NamedTuple):
    """Shape of a vent.

    Attributes
    ----------
    half : half of its width in metres.
    eaves_height : range of metres from the roof at its middle to its top.
    behind : range of metres from the roof's edge back to its middle.
    """

    half: float
    eaves_height: tuple[float, float]
    behind: tuple[float, float]


COWL_SHAPE = VentShape(0.075, (0.4, 0.65), (0.9, 3.2))
BOX_SHAPE = VentShape(0.32, (0.9, 1.3), (0.8, 1.8))


def build_vents(
    id: str,
    roof: Facets,
    outline: Polygon,
    surroundings: RoofSurroundings,
    eaves_height: float,
    existing: list[RoofDetail | None],
) -> RoofDetail | None:
    """Build the vents of a pitched roof; a vent has 10 triangles.

    Parameters
    ----------
    id : seed of the random draws.
    roof : facets of the roof.
    outline : footprint of the building.
    surroundings : surroundings of the roof's edges.
    eaves_height : metres from the ground to the eaves.
    existing : details that are on the roof already.

    Returns
    -------
    None without vents.
    """
    edges = [edge for edge in roof_edges(roof, outline) if abs(edge.end[2] - edge.start[2]) < 0.02]
    edges = cut_free_roof_edges(
        [edge for edge in edges if VENTS.slope_range[0] < edge.slope < VENTS.slope_range[1]], surroundings
    )
    blocked = shapely.union_all(
        [place.buffer(VENTS.clearance_m) for trim in existing if trim for place in _facet_areas(trim.facets)]
    )
    room = {}
    for facet in {edge.facet for edge in edges}:
        mine = roof.vertices[roof.triangles[roof.facet == facet]]
        room[facet] = shapely.union_all(shapely.polygons(mine[..., :2])).difference(blocked)
    return _place_vents(id, edges, [room[edge.facet] for edge in edges], surroundings, eaves_height, COWL_SHAPE)


def build_flat_roof_vents(
    id: str, outline: Polygon, top: float, surroundings: RoofSurroundings, eaves_height: float
) -> RoofDetail | None:
    """Build the vents of a flat roof with a parapet.

    Parameters
    ----------
    id : seed of the random draws.
    outline : footprint of the building.
    top : height of the roof in metres.
    surroundings : surroundings of the roof's edges.
    eaves_height : metres from the ground to the roof.
    """
    ring = np.asarray(shapely.orient_polygons(outline).exterior.coords)
    corners = np.column_stack([ring, np.full(len(ring), top)])
    edges = cut_free_roof_edges(
        [RoofEdge(a, b, -1, 0.0, 0.0) for a, b in zip(corners[:-1], corners[1:], strict=True)], surroundings
    )
    return _place_vents(id, edges, [outline] * len(edges), surroundings, eaves_height, BOX_SHAPE)


def _place_vents(
    id: str,
    edges: list[RoofEdge],
    room: list[Polygon | BaseGeometry],
    surroundings: RoofSurroundings,
    eaves_height: float,
    size: VentShape,
) -> RoofDetail | None:
    """Place vents behind edges, within the free area `room` of each seen from above."""
    seed = blake2b(id.encode(errors="surrogatepass"), digest_size=8, person=b"vents").digest()
    rng = np.random.default_rng(int.from_bytes(seed))
    if rng.random() > VENTS.vent_share:
        return None
    faces, built = RoofDetailBuilder(), 0
    for edge, free in zip(edges, room, strict=True):
        length = float(np.hypot(*(edge.end - edge.start)[:2]))
        for _ in range(int(length / VENTS.spacing_m)):
            share, *drawn = rng.random(3)
            rise, behind = (low + part * (most - low) for part, (low, most) in zip(drawn, size[1:], strict=True))
            middle = (
                edge.start[:2]
                + (VENTS.end_distance_m + share * (length - 2 * VENTS.end_distance_m)) * edge.direction
                - behind * edge.outward
            )
            if built == VENTS.max_vents or not _is_in_sight(edge, middle, behind, rise, surroundings, eaves_height):
                continue
            square = shapely.box(*(middle - size.half), *(middle + size.half)).buffer(size.half)
            if free.contains(square):
                _add_vent(faces, edge, middle, behind, rise, size.half)
                free, built = free.difference(square.buffer(1.0)), built + 1
    return faces.build() if built else None


def _is_in_sight(
    edge: RoofEdge,
    middle: Float64Array,
    behind: float,
    rise: float,
    surroundings: RoofSurroundings,
    eaves_height: float,
) -> bool:
    """Return whether the top of a vent is seen over the roof's edge from a street in front."""
    if not len(surroundings.street_points):
        return True
    away = multiply_matrices(surroundings.street_points - middle, edge.outward) - behind
    near = away[(away > 1.0) & (np.hypot(*(surroundings.street_points - middle).T) < ROOF_EDGES.max_sight_m)]
    lip = 0.0 if edge.slope else EAVES.parapet_m
    seen = behind * edge.slope + VENTS.visible_top * rise - lip
    return bool(((eaves_height + lip - VENTS.eye_height_m) * behind < seen * near).any())


def _add_vent(
    faces: RoofDetailBuilder, edge: RoofEdge, middle: Float64Array, behind: float, rise: float, half: float
) -> None:
    """Add a vent, with two adjacent sides per chart."""
    ahead, out = half * np.append(edge.direction, 0.0), half * np.append(edge.outward, 0.0)
    level = edge.start[2] + behind * edge.slope
    foot = np.append(middle, level - half * edge.slope - VENTS.buried_m)
    top = np.append(middle, level + rise)
    turns = (out - ahead, out + ahead, ahead - out, -ahead - out)  # counter-clockwise from above
    for k in (0, 2):
        left, corner, right = turns[k], turns[(k + 1) % 4], turns[(k + 2) % 4]
        sides = [[foot + one, foot + other, top + other, top + one] for one, other in ((left, corner), (corner, right))]
        faces.add_bent_strip(ChartKind.METAL, sides, right - left)
    faces.add_polygon(ChartKind.METAL, [top + turn for turn in turns])


def _facet_areas(facets: Facets) -> list[BaseGeometry]:
    """Return the area of each facet seen from above."""
    return [
        shapely.multipoints(facets.vertices[np.unique(facets.triangles[facets.facet == facet]), :2]).convex_hull
        for facet in range(len(facets))
    ]
