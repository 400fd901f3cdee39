"""Chimneys on roofs of assumed shape: few, near the ridge, at random places by the building's id."""

from __future__ import annotations

from hashlib import blake2b

import numpy as np
import shapely
from shapely import Polygon

from facade_core.core.arrays import Float64Array
from facade_core.core.fixed_order import dot_product
from facade_core.geometry.buildings.facets import Facets
from facade_core.geometry.buildings.roof_details import RoofDetail, RoofDetailBuilder
from facade_core.geometry.buildings.settings import CHIMNEYS
from facade_core.geometry.charts import ChartKind


def build_chimneys(id: str, roof: Facets, outline: Polygon) -> RoofDetail | None:
    """Build the chimneys of a building, at most 20 triangles.

    Parameters
    ----------
    id : seed of the random draws.
    roof : facets of the roof.
    outline : footprint of the building.

    Returns
    -------
    None without a chimney.
    """
    rng = np.random.default_rng(int.from_bytes(blake2b(id.encode(errors="surrogatepass"), digest_size=8).digest()))
    if outline.area < CHIMNEYS.min_roof_m2 or rng.random() > CHIMNEYS.chimney_share:
        return None
    within = outline.buffer(-CHIMNEYS.min_inset_m)
    west, south, east, north = outline.bounds
    places = [west, south] + rng.random((CHIMNEYS.candidates, 2)) * [east - west, north - south]
    places = places[shapely.contains_xy(within, *places.T)]
    heights = _roof_heights(roof, places)
    faces = RoofDetailBuilder()
    turn = _longest_edge_direction(outline)
    built: list[Float64Array] = []
    for place in places[np.argsort(-np.nan_to_num(heights, nan=-np.inf), kind="stable")]:
        if len(built) == (2 if outline.area > CHIMNEYS.min_roof_of_two_m2 else 1):
            break
        if all(np.hypot(*(place - other)) > CHIMNEYS.min_spacing_m for other in built) and _add_chimney(
            faces, rng, roof, place, turn
        ):
            built.append(place)
    return faces.build() if built else None


def _add_chimney(
    faces: RoofDetailBuilder, rng: np.random.Generator, roof: Facets, place: Float64Array, along: Float64Array
) -> bool:
    """Add a chimney at a place (2,), its long side `along`; False where it would cross the roof's edge."""
    long, high = (low + rng.random() * (most - low) for low, most in (CHIMNEYS.length_m, CHIMNEYS.height_m))
    across = np.array([-along[1], along[0]])
    # counter-clockwise from above
    corners = place + [
        x * along * long / 2 + y * across * CHIMNEYS.width_m / 2 for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    under = _roof_heights(roof, np.concatenate([corners, place[None]]))
    if not np.isfinite(under).all():
        return False
    low = np.column_stack([corners, np.full(4, under.min() - CHIMNEYS.buried_m)])
    top = np.column_stack([corners, np.full(4, under[-1] + high)])
    for k in range(4):
        after = (k + 1) % 4
        faces.add_polygon(ChartKind.WALL, [low[k], low[after], top[after], top[k]])
    faces.add_polygon(ChartKind.ROOF, list(top))
    return True


def _roof_heights(roof: Facets, places: Float64Array) -> Float64Array:
    """Return the height of a roof in metres at places (k, 2), NaN outside."""
    upper = roof.kind[roof.facet] == ChartKind.ROOF
    corners = roof.vertices[roof.triangles[upper]]
    found = np.full(len(places), np.nan)
    tree = shapely.STRtree(shapely.polygons(corners[..., :2]))
    for place, triangle in zip(*tree.query(shapely.points(places), predicate="intersects"), strict=True):
        normal = roof.normal[roof.facet[upper][triangle]]
        first = corners[triangle, 0]
        height = first[2] - dot_product(normal[:2], places[place] - first[:2]) / normal[2]
        found[place] = np.fmax(found[place], height)
    return found


def _longest_edge_direction(outline: Polygon) -> Float64Array:
    """Return the direction (2,) of the longest edge of an outline."""
    edges = np.diff(np.asarray(outline.exterior.coords), axis=0)
    longest = edges[np.argmax(np.hypot(*edges.T))]
    direction: Float64Array = longest / np.hypot(*longest)
    return direction
