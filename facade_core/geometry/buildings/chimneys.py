"""Chimneys on roofs whose shape is assumed: few, near the ridge, where the building's id puts them."""

from __future__ import annotations

from hashlib import blake2b

import numpy as np
import shapely
from shapely import Polygon

from facade_core.geometry.buildings.facets import Facets
from facade_core.geometry.buildings.roof_details import Faces, Trim
from facade_core.geometry.charts import ChartKind

# Roofs of pitched shapes over this many square metres have one, in this share of all cases; from the third figure on two.
LEAST_M2, SHARE, TWO_M2 = 60.0, 0.7, 900.0
# Of so many places the highest is taken; they lie this far inside of the outline, two chimneys this far apart.
PLACES, INSIDE_M, APART_M = 24, 1.6, 6.0
# A chimney's width, and the least and greatest of its length and of its height over the roof at its middle.
WIDE_M, LONG_M, HIGH_M = 0.6, (0.7, 1.5), (0.8, 1.3)
# It begins so far below the lowest place of the roof around it.
SUNK_M = 0.05


def chimneys(id: str, roof: Facets, outline: Polygon) -> Trim | None:
    """The chimneys of a building on the facets of its roof; None where it has none. No more than 20 triangles."""
    rng = np.random.default_rng(int.from_bytes(blake2b(id.encode(errors="surrogatepass"), digest_size=8).digest()))
    if outline.area < LEAST_M2 or rng.random() > SHARE:
        return None
    within = outline.buffer(-INSIDE_M)
    west, south, east, north = outline.bounds
    places = [west, south] + rng.random((PLACES, 2)) * [east - west, north - south]
    places = places[shapely.contains_xy(within, *places.T)]
    heights = _heights(roof, places)
    faces = Faces()
    turn = _longest(outline)
    built: list[np.ndarray] = []
    for place in places[np.argsort(-np.nan_to_num(heights, nan=-np.inf), kind="stable")]:
        if len(built) == (2 if outline.area > TWO_M2 else 1):
            break
        if all(np.hypot(*(place - other)) > APART_M for other in built) and _build(faces, rng, roof, place, turn):
            built.append(place)
    return faces.trim() if built else None


def _build(faces: Faces, rng: np.random.Generator, roof: Facets, place: np.ndarray, along: np.ndarray) -> bool:
    """Put a chimney at a place (2,), its long side `along`; False where it would stand over the roof's edge."""
    long, high = (low + rng.random() * (most - low) for low, most in (LONG_M, HIGH_M))
    across = np.array([-along[1], along[0]])
    # counter-clockwise from above
    corners = place + [x * along * long / 2 + y * across * WIDE_M / 2 for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    under = _heights(roof, np.concatenate([corners, place[None]]))
    if not np.isfinite(under).all():
        return False
    low = np.column_stack([corners, np.full(4, under.min() - SUNK_M)])
    top = np.column_stack([corners, np.full(4, under[-1] + high)])
    for k in range(4):
        after = (k + 1) % 4
        faces.add(ChartKind.WALL, [low[k], low[after], top[after], top[k]])
    faces.add(ChartKind.ROOF, list(top))
    return True


def _heights(roof: Facets, places: np.ndarray) -> np.ndarray:
    """How high a roof is at places (k, 2), metres; NaN beside it."""
    upper = roof.kind[roof.facet] == ChartKind.ROOF
    corners = roof.vertices[roof.triangles[upper]]
    found = np.full(len(places), np.nan)
    tree = shapely.STRtree(shapely.polygons(corners[..., :2]))
    for place, triangle in zip(*tree.query(shapely.points(places), predicate="intersects"), strict=True):
        normal = roof.normal[roof.facet[upper][triangle]]
        first = corners[triangle, 0]
        height = first[2] - normal[:2] @ (places[place] - first[:2]) / normal[2]
        found[place] = np.fmax(found[place], height)
    return found


def _longest(outline: Polygon) -> np.ndarray:
    """The direction (2,) of an outline's longest edge."""
    edges = np.diff(np.asarray(outline.exterior.coords), axis=0)
    longest = edges[np.argmax(np.hypot(*edges.T))]
    return longest / np.hypot(*longest)
