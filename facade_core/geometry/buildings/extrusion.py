"""Footprints extruded: walls on every edge, roofs, undersides and skirts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
from shapely import Polygon

from facade_core.geometry.buildings.facets import Facets
from facade_core.geometry.buildings.roof_shapes import GRID_M
from facade_core.geometry.buildings.shells import SKIRT_M, add_facets
from facade_core.geometry.charts import ChartKind, Pieces
from facade_core.geometry.cutting import SHORTEST_WALL_M, line_cuts
from facade_core.geometry.ground.ground_charts import FINER, add_level, add_planar
from facade_core.geometry.ground.terrain import Terrain

_DOWN = np.array([0.0, 0.0, -1.0])


def add_extruded(
    pieces: Pieces,
    index: int,
    outline: Polygon,
    base: float,
    height: float,
    terrain: Terrain,
    largest: float,
    grid: float,
    roof: Facets | None = None,
    raised: float = 0.0,
) -> None:
    """Walls on every edge, a flat roof or the facets of one, and a skirt down to the terrain where it lies lower; of what
    begins `raised` metres above its base an underside instead."""
    foot, eaves = base + raised, base + height
    joints = np.empty((0, 2)) if roof is None else roof.vertices[roof.vertices[:, 2] >= eaves, :2]
    rings = [np.asarray(ring.coords) for ring in (outline.exterior, *outline.interiors)]
    edges = [edge for ring in rings for edge in zip(ring[:-1], ring[1:], strict=True)]
    for a, b in edges:
        _wall(pieces, index, a, b, foot, eaves, largest, grid, joints)
    if roof is None:
        add_level(pieces, ChartKind.ROOF, index, outline, eaves, largest, grid)
    if raised > 0:
        add_level(pieces, ChartKind.CEILING, index, outline, foot, largest, grid)
    else:
        _skirt(pieces, index, edges, base, terrain, largest, grid)
    if roof is not None:
        add_facets(pieces, index, roof, largest, grid)


def _skirt(
    pieces: Pieces,
    index: int,
    edges: Sequence[tuple[np.ndarray, np.ndarray]],
    base: float,
    terrain: Terrain,
    largest: float,
    grid: float,
) -> None:
    for a, b in edges:
        length = float(np.hypot(*(b - a)))
        steps = line_cuts(a, b, length, grid / FINER[-1]) / max(length, SHORTEST_WALL_M)
        foot = float(terrain.height(a + steps[:, None] * (b - a)).min())
        if base - foot > SKIRT_M:
            _wall(pieces, index, a, b, foot, base, largest, grid)


def above(found: Facets, height: float) -> Facets:
    """The facets that lie above a height."""
    low = np.full(len(found), np.inf)
    np.minimum.at(low, found.facet, found.vertices[found.triangles][..., 2].min(axis=1))
    kept = low > height - GRID_M
    mine = kept[found.facet]
    return replace(
        found,
        triangles=found.triangles[mine],
        facet=(np.cumsum(kept) - 1)[found.facet[mine]],
        texture=found.texture[mine],
        uv=found.uv[mine],
        kind=found.kind[kept],
        normal=found.normal[kept],
    )


def _wall(
    pieces: Pieces,
    index: int,
    a: np.ndarray,
    b: np.ndarray,
    low: float,
    high: float,
    largest: float,
    grid: float,
    joints: np.ndarray | None = None,
) -> None:
    """The wall over an edge with the building on its left, so that the edge runs left to right seen from outside.

    joints (k, 2): where something on top of it has corners; those on the edge are the wall's too.
    """
    length, height = float(np.hypot(*(b - a))), high - low
    if length < SHORTEST_WALL_M:
        return
    along = np.append((b - a) / length, 0.0)
    cuts = line_cuts(a, b, length, grid) if length > largest else np.array([0.0, length])
    levels = np.arange(0.0, height, grid) if height > largest else np.array([0.0])
    levels = np.append(levels, height)
    steps = np.empty(0) if joints is None else _on_edge(a, along[:2], length, joints)
    for left, right in zip(cuts[:-1], cuts[1:], strict=True):
        for bottom, top in zip(levels[:-1], levels[1:], strict=True):
            origin = np.array([a[0], a[1], low + top]) + left * along
            met = steps[(steps > left) & (steps < right)] - left if top == height else steps[:0]
            _rectangle(pieces, index, origin, along, right - left, top - bottom, met)
    pieces.surfaces += 1


def _rectangle(
    pieces: Pieces, index: int, origin: np.ndarray, along: np.ndarray, width: float, height: float, met: np.ndarray
) -> None:
    """A wall's chart of the current surface, with corners at `met` (k,) metres from the left on its upper edge too."""
    if not len(met):
        add_planar(pieces, ChartKind.WALL, index, origin, along, _DOWN, shapely.box(0, 0, width, height))
        return
    x = np.concatenate([[0.0, width, width], met[::-1], [0.0]])
    y = np.concatenate([[height, height], np.zeros(len(met) + 2)])
    fan = np.arange(1, len(x) - 1)
    triangles = np.column_stack([np.zeros(len(fan), np.int64), fan, fan + 1])
    one = [
        np.array([value]) for value in (ChartKind.WALL, pieces.surfaces, index, origin, along, _DOWN, (width, height))
    ]
    vertices = origin + x[:, None] * along + y[:, None] * _DOWN
    pieces.add_charts(tuple(one), (vertices, triangles, np.zeros(len(fan), np.int64), np.zeros(len(x), np.int64)))


def _on_edge(start: np.ndarray, along: np.ndarray, length: float, points: np.ndarray) -> np.ndarray:
    """How far along an edge the points (k, 2) on it lie, ascending, its ends left out."""
    offset = points - start
    step = offset @ along
    off = np.abs(offset[:, 0] * along[1] - offset[:, 1] * along[0])
    return np.unique(np.round(step[(off < 2 * GRID_M) & (step > GRID_M) & (step < length - GRID_M)], 6))
