"""Buildings and ground into planar charts and a mesh: extruded footprints, roofs, shells and the terrain around them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from facade_core.errors import GeometryError
from facade_core.geometry.charts import ROOF, WALL, Charts, Mesh, Pieces, frames
from facade_core.geometry.chimneys import chimneys
from facade_core.geometry.cutting import SHORTEST_WALL_M, cut_triangles, line_cuts
from facade_core.geometry.eaves import (
    ASIDE_M,
    LOW_ROOF_M,
    OPEN,
    OVERHANG_M,
    Around,
    Trim,
    along_streets,
    overhang,
    parapet,
)
from facade_core.geometry.facets import Facets, facets, walled
from facade_core.geometry.ground import FINER, add_ground, add_level, add_planar
from facade_core.geometry.roofs import GRID_M, roof_shell
from facade_core.geometry.terrain import Terrain
from facade_core.types import Building, Street

# Footprint vertices nearer than this to the wall they lie on do not split it into two facades.
COLLINEAR_M = 0.2
# Ground reaches this far around buildings, and fills gaps between them up to twice the second figure.
FORECOURT_M = 6.0
COURTYARD_M = 22.0
# A gap of this much between a building and the terrain below it is closed by a wall.
SKIRT_M = 0.05
# The lower edges of a shell's walls: on its outline and near its lowest point.
OUTLINE_M = 0.3
FOOT_M = 2.0
# A roof runs on over neighbours whose walls are at least this share of its own's.
AS_HIGH = 0.5
# A shell with walls along less of its free outline is a canopy: the ground goes on under it.
WALLED = 0.6
# A neighbour that ends this much lower is in no eaves' way.
LOWER_M = 0.5

_DOWN = np.array([0.0, 0.0, -1.0])


def block_surfaces(
    buildings: Sequence[Building],
    streets: Sequence[Street],
    *,
    terrain: Terrain,
    ground_margin: float,
    largest: float,
    grid: float = 32.0,
    within: Polygon | None = None,
) -> tuple[Charts, Mesh, tuple[tuple[str, str], ...]]:
    """Charts and mesh of a block: the surfaces of every building, and the ground near the streets on the terrain.

    Third, the buildings without usable surfaces, which are left out: (id, reason).

    Surfaces longer than `largest` metres, and all ground, are cut on the world grid of `grid` metres (ground finer where it is
    uneven); pieces keep their surface's id. Ground reaches `ground_margin` metres from the centrelines, and fills
    courtyards; it ends straight where a street ends, and FORECOURT_M beyond `within`, where a block has one.
    Raises GeometryError when nothing is left.
    """
    pieces = Pieces()
    refused, outlines = [], []
    beside = shapely.STRtree([building.footprint for building in buildings])
    eyes = along_streets([street.line for street in streets])
    for index, building in enumerate(buildings):
        try:
            party = _beside(index, buildings, beside)
            around = Around(_in_the_way(index, buildings, beside, terrain), eyes, beside)
            outline, found = add_building(pieces, index, building, terrain, party, around, largest=largest, grid=grid)
        except GeometryError as error:
            refused.append((building.id, str(error)))
            continue
        if building.shell is None or found is None or walled(found, _free(index, buildings, beside)) >= WALLED:
            outlines.append(outline)
    if streets:
        near = [street.line.buffer(ground_margin, cap_style="square", join_style="mitre") for street in streets]
        built = shapely.union_all(outlines)
        # closing the footprints covers courtyards and gaps that no street comes near
        around = built.buffer(COURTYARD_M).buffer(FORECOURT_M - COURTYARD_M)
        open_ground = shapely.union_all([*near, around]).difference(built)
        if within is not None:
            end = shapely.union_all([within, shapely.union_all(outlines)]).buffer(FORECOURT_M, join_style="mitre")
            open_ground = open_ground.intersection(end)
        parts = sorted(shapely.get_parts(open_ground), key=lambda p: p.bounds)
        add_ground(pieces, [p for p in parts if p.geom_type == "Polygon" and p.area > 0.01], terrain, grid)
    if not len(pieces):
        why = f": {refused[0][0]}: {refused[0][1]}" if refused else "; check its area and input files"
        raise GeometryError(f"the block has neither buildings nor streets{why}")
    return *pieces.values(), tuple(refused)


def add_building(
    pieces: Pieces,
    index: int,
    building: Building,
    terrain: Terrain,
    beside: Sequence[Polygon | MultiPolygon] = (),
    around: Around = OPEN,
    *,
    largest: float,
    grid: float = 32.0,
) -> tuple[Polygon | MultiPolygon, Facets | None]:
    """The surfaces of one building behind those in `pieces`. Raises GeometryError where it has none.

    beside: the footprints that its roof runs on over; around: what its roof's edge has about it. Returns what it covers, and a
    shell's facets, None of what is built here.
    """
    outline = _outline(building)
    if building.shell is not None:
        shell = building.shell
    else:
        if not (np.isfinite(building.height) and building.height > 0):
            raise GeometryError("its height is not above 0; state one or drop it")
        base = terrain.lowest(outline) if building.base is None else building.base
        onto_grid = shapely.transform(outline, lambda xy: np.round(xy / GRID_M) * GRID_M)
        roofed = roof_shell(replace(building, footprint=onto_grid), base, beside) if onto_grid.is_valid else None
        stacks: Trim | None = None
        if roofed is None:
            flat = building.roof is not None and building.roof.shape == "flat" and building.height > LOW_ROOF_M
            edge = parapet(outline, base + building.height, around) if flat else None
            _extruded(pieces, index, outline, base, building.height, terrain, largest, grid)
        else:
            closed = _above(facets(roofed, outline), base + building.height)
            roof, edge = overhang(closed, onto_grid, around)
            _extruded(pieces, index, onto_grid, base, building.height, terrain, largest, grid, roof)
            if building.roof is not None and building.roof.confidence < 1:
                stacks = chimneys(building.id, closed, onto_grid)
        for trim in (edge, stacks):
            if trim is not None:
                _facets(pieces, index, trim.facets, largest, grid, trim.along)
        return outline, None
    found = facets(shell, outline)
    if len(found) == 0:
        raise GeometryError("its model has no surface; repair or drop it")
    _facets(pieces, index, found, largest, grid)
    _shell_skirt(pieces, index, found, outline, terrain, largest, grid)
    return outline, found


def _beside(index: int, buildings: Sequence[Building], tree: shapely.STRtree) -> list[Polygon | MultiPolygon]:
    """The footprints of a building's neighbours that are not much lower than it."""
    own = buildings[index]
    if own.roof is None or not own.roof.height > 0:
        return []
    near = sorted(tree.query(own.footprint, predicate="dwithin", distance=OUTLINE_M).tolist())
    others = [buildings[i] for i in near if i != index]
    return [other.footprint for other in others if other.height >= AS_HIGH * own.height and other.footprint.is_valid]


def _in_the_way(index: int, buildings: Sequence[Building], tree: shapely.STRtree, terrain: Terrain) -> BaseGeometry:
    """What a building's neighbours cover that reach up to its eaves."""
    own = buildings[index]
    if own.shell is not None or not np.isfinite(own.height):
        return OPEN.high
    least = _base(own, terrain) + own.height - LOWER_M
    near = [i for i in tree.query(own.footprint, predicate="dwithin", distance=OVERHANG_M + ASIDE_M) if i != index]
    high = [
        one for one in (buildings[i] for i in sorted(near)) if one.footprint.is_valid and _top(one, terrain) > least
    ]
    return shapely.union_all([one.footprint for one in high])


def _base(building: Building, terrain: Terrain) -> float:
    return terrain.lowest(building.footprint) if building.base is None else building.base


def _top(building: Building, terrain: Terrain) -> float:
    return _base(building, terrain) + building.height + (building.roof.height if building.roof else 0.0)


def _free(index: int, buildings: Sequence[Building], tree: shapely.STRtree) -> shapely.Geometry:
    """The line along which a building's outline is not another's too: party walls are often left out of models."""
    footprint = buildings[index].footprint
    others = [i for i in tree.query(footprint, predicate="dwithin", distance=OUTLINE_M) if i != index]
    touched = shapely.union_all([buildings[i].footprint for i in others]).buffer(OUTLINE_M)
    return shapely.difference(footprint.boundary, touched)


def _outline(building: Building) -> Polygon | MultiPolygon:
    """What a building covers; only a shell may be in several parts."""
    footprint = shapely.orient_polygons(building.footprint.simplify(COLLINEAR_M))
    kinds = ("Polygon",) if building.shell is None else ("Polygon", "MultiPolygon")
    if footprint.geom_type not in kinds or not footprint.area > 0:
        raise GeometryError("its footprint has no area; repair or drop it")
    if not footprint.is_valid:
        raise GeometryError("its footprint crosses itself; repair or drop it")
    return footprint


def _extruded(
    pieces: Pieces,
    index: int,
    outline: Polygon,
    base: float,
    height: float,
    terrain: Terrain,
    largest: float,
    grid: float,
    roof: Facets | None = None,
) -> None:
    """Walls on every edge, a flat roof or the facets of one, and a skirt down to the terrain where it lies lower."""
    eaves = base + height
    joints = np.empty((0, 2)) if roof is None else roof.vertices[roof.vertices[:, 2] >= eaves, :2]
    rings = [np.asarray(ring.coords) for ring in (outline.exterior, *outline.interiors)]
    edges = [edge for ring in rings for edge in zip(ring[:-1], ring[1:], strict=True)]
    for a, b in edges:
        _wall(pieces, index, a, b, base, eaves, largest, grid, joints)
    if roof is None:
        add_level(pieces, ROOF, index, outline, eaves, largest, grid)
    for a, b in edges:
        length = float(np.hypot(*(b - a)))
        steps = line_cuts(a, b, length, grid / FINER[-1]) / max(length, SHORTEST_WALL_M)
        foot = float(terrain.height(a + steps[:, None] * (b - a)).min())
        if base - foot > SKIRT_M:
            _wall(pieces, index, a, b, foot, base, largest, grid)
    if roof is not None:
        _facets(pieces, index, roof, largest, grid)


def _above(found: Facets, height: float) -> Facets:
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
        add_planar(pieces, WALL, index, origin, along, _DOWN, shapely.box(0, 0, width, height))
        return
    x = np.concatenate([[0.0, width, width], met[::-1], [0.0]])
    y = np.concatenate([[height, height], np.zeros(len(met) + 2)])
    fan = np.arange(1, len(x) - 1)
    triangles = np.column_stack([np.zeros(len(fan), np.int64), fan, fan + 1])
    one = [np.array([value]) for value in (WALL, pieces.surfaces, index, origin, along, _DOWN, (width, height))]
    vertices = origin + x[:, None] * along + y[:, None] * _DOWN
    pieces.add_charts(tuple(one), (vertices, triangles, np.zeros(len(fan), np.int64), np.zeros(len(x), np.int64)))


def _on_edge(start: np.ndarray, along: np.ndarray, length: float, points: np.ndarray) -> np.ndarray:
    """How far along an edge the points (k, 2) on it lie, ascending, its ends left out."""
    offset = points - start
    step = offset @ along
    off = np.abs(offset[:, 0] * along[1] - offset[:, 1] * along[0])
    return np.unique(np.round(step[(off < 2 * GRID_M) & (step > GRID_M) & (step < length - GRID_M)], 6))


def _facets(
    pieces: Pieces, index: int, facets: Facets, largest: float, grid: float, along: np.ndarray | None = None
) -> None:
    """Facets as charts, with their right `along` (f, 3) if that is given; those longer than `largest` are cut on the grid."""
    axis_u, axis_v = frames(facets.normal) if along is None else (along, np.cross(along, facets.normal))
    vertices, triangles, uv = facets.vertices, facets.triangles, facets.uv
    corners = vertices[triangles]
    first = np.searchsorted(facets.facet, np.arange(len(facets)))
    long = np.zeros(len(facets), bool)
    for axis in (axis_u, axis_v):
        place = np.einsum("tcj,tj->tc", corners, axis[facets.facet])
        extent = np.maximum.reduceat(place.max(axis=1), first) - np.minimum.reduceat(place.min(axis=1), first)
        long |= extent > largest
    if not long.any():
        parts = [(facets.facet, np.zeros(len(triangles), np.int64), triangles, uv, facets.texture)]
    else:
        whole = ~long[facets.facet]
        parts = [
            (facets.facet[whole], np.zeros(whole.sum(), np.int64), triangles[whole], uv[whole], facets.texture[whole])
        ]
        for f in np.flatnonzero(long):
            mine = facets.facet == f
            vertices, cut, cut_uv, source, cell = cut_triangles(vertices, triangles[mine], uv[mine], grid)
            parts.append((np.full(len(cut), f), cell, cut, cut_uv, facets.texture[mine][source]))
    facet, cell, triangles, uv, texture = (np.concatenate(column) for column in zip(*parts, strict=True))
    surface, chart = np.unique(facet * (cell.max() + 1) + cell, return_inverse=True)
    surface //= cell.max() + 1
    order = np.argsort(chart, kind="stable")
    pieces.add(
        facets.kind[surface], surface, index, axis_u[surface], axis_v[surface],
        vertices, triangles[order], chart[order], texture[order], uv[order],
    )  # fmt: skip


def _shell_skirt(
    pieces: Pieces,
    index: int,
    facets: Facets,
    outline: Polygon | MultiPolygon,
    terrain: Terrain,
    largest: float,
    grid: float,
) -> None:
    """Walls from the open lower edges of a shell's walls down to the terrain, one surface per facet."""
    edges = np.concatenate([facets.triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    key = np.sort(edges, axis=1) @ [len(facets.vertices), 1]
    _, of, uses = np.unique(key, return_inverse=True, return_counts=True)
    facet = np.tile(facets.facet, 3)
    ends = facets.vertices[edges]
    gap = ends[..., 2] - terrain.height(ends.reshape(-1, 3)[:, :2]).reshape(-1, 2)
    run = np.hypot(*(ends[:, 1] - ends[:, 0])[:, :2].T)
    # counter-clockwise seen from outside, the lower edge of a wall runs to the right
    right = np.einsum("ij,ij->i", (ends[:, 1] - ends[:, 0])[:, :2], frames(facets.normal)[0][facet][:, :2])
    foot = (
        (uses[of] == 1)
        & (np.abs(facets.normal[facet, 2]) < 0.5)
        & (right > 0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))
        & (ends[..., 2].max(axis=1) < facets.vertices[:, 2].min() + FOOT_M)
        & (gap.max(axis=1) > SKIRT_M)
        & (run > SHORTEST_WALL_M)
    )
    foot &= shapely.distance(outline.boundary, shapely.points(ends.mean(axis=1)[:, :2])) < OUTLINE_M
    if not foot.any():
        return
    a, b = ends[foot, 0], ends[foot, 1]
    drop = np.maximum(gap[foot], 0)
    for share in (0.25, 0.5, 0.75):  # uneven ground lies lower than its ends somewhere between
        between = a + share * (b - a) - np.array([0, 0, 1]) * (drop @ [1 - share, share])[:, None]
        drop += np.maximum(between[:, 2] - terrain.height(between[:, :2]), 0)[:, None]
    low = [p - drop[:, k : k + 1] * [0, 0, 1] for k, p in enumerate((a, b))]
    order = np.argsort(facet[foot], kind="stable")
    of_facet, chart = np.unique(facet[foot][order], return_inverse=True)
    normal = facets.normal[of_facet] * [1, 1, 0]
    n = len(order)
    quads = np.stack([order + k * n for k in (2, 3, 1, 2, 1, 0)], axis=1)
    skirt = Facets(
        vertices=np.concatenate([a, b, *low]),
        triangles=quads.reshape(-1, 3),
        facet=np.repeat(chart, 2),
        texture=np.full(2 * n, -1, np.int32),
        uv=np.zeros((2 * n, 3, 2), np.float32),
        kind=np.full(len(of_facet), WALL, np.uint8),
        normal=normal / np.linalg.norm(normal, axis=1, keepdims=True),
    )
    _facets(pieces, index, skirt, largest, grid)
