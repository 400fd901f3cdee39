"""Planar, outward facets from the triangles of a building's shell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, Int32Array, Int64Array, UInt8Array
from facade_core.core.errors import GeometryError
from facade_core.core.numba_cache import njit
from facade_core.core.types import SEMANTICS, BuildingShell
from facade_core.geometry.buildings.settings import FACETS
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.surface_crossings import RayCrossingCounter

# Metres from a triangle of a facet to the facet's plane.
MAX_OFF_PLANE_M = 0.1
# Cosine between the normals of a triangle and its facet: 3 degrees.
MIN_NORMAL_COSINE = np.cos(np.radians(3.0))
# Accuracy of source vertices in metres, which bounds that of a thin triangle's normal.
VERTEX_ACCURACY_M = 0.01

_KIND_OF_SEMANTIC = {
    "wall": ChartKind.WALL,
    "roof": ChartKind.ROOF,
    "window": ChartKind.WINDOW,
    "door": ChartKind.DOOR,
    "ceiling": ChartKind.CEILING,
}
_GROUND, _ROOF, _CEILING, _UNKNOWN, _WALL = (
    SEMANTICS.index(s) for s in ("ground", "roof", "ceiling", "unknown", "wall")
)


@dataclass(frozen=True, slots=True, eq=False)
class Facets:
    """Planar facets of a shell as columns, without its underside.

    Attributes
    ----------
    vertices : (v, 3) welded, metres.
    triangles : (t, 3) vertex indices, counter-clockwise from outside, sorted by facet.
    facet : (t,) facet of each triangle.
    texture : (t,) as in `Shell`.
    uv : (t, 3, 2) as in `Shell`.
    kind : (f,) `ChartKind`.
    normal : (f, 3) outward unit vectors.
    """

    vertices: Float64Array
    triangles: Int64Array
    facet: Int64Array
    texture: Int32Array
    uv: Float32Array
    kind: UInt8Array
    normal: Float64Array

    def __len__(self) -> int:
        return len(self.kind)


def extract_shell_facets(shell: BuildingShell, footprint: Polygon | MultiPolygon) -> Facets:
    """Group the triangles of a shell into connected planar facets of one semantic and texture.

    The winding is the last resort. An upright facet has the footprint behind it. A facet inside the footprint, or a
    level one, is decided by the number of surfaces on either side. Facets below `min_facet_m2` are dropped.

    Parameters
    ----------
    footprint : outline of the building.

    Raises
    ------
    GeometryError Where coordinates are not finite, or indices have no vertex.
    """
    if not np.isfinite(shell.vertices).all():
        raise GeometryError("its model has coordinates that are not numbers; repair or drop it")
    if shell.triangles.size and not 0 <= shell.triangles.min() <= shell.triangles.max() < len(shell.vertices):
        raise GeometryError("its model has triangles without a vertex; repair or drop it")
    vertices, triangles, area, kept = _weld(shell)
    semantic, texture, uv = shell.semantic[kept].astype(np.int64), shell.texture[kept], shell.uv[kept]
    length = np.linalg.norm(area, axis=1)
    label = semantic + len(SEMANTICS) * (texture.astype(np.int64) + 1)
    order = np.lexsort((np.arange(len(triangles)), -length))
    ends = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)]), axis=0)
    key = (ends[0] * len(vertices) + ends[1]).ravel()
    by_edge = np.argsort(key, kind="stable")
    facet, seed, closed = _grow_facets(vertices, triangles, label, area / length[:, None], length, order, key, by_edge)

    count = len(seed)
    turned = np.einsum("ij,ij->i", area, area[seed][facet]) < 0
    aligned = np.where(turned[:, None], -area, area)
    normal = np.stack([np.bincount(facet, aligned[:, k], count) for k in range(3)], axis=1)
    size = np.linalg.norm(normal, axis=1)
    normal = normal / np.maximum(size, 1e-12)[:, None]
    # majority winding by area
    normal[np.bincount(facet, np.where(turned, -length, length), count) < 0] *= -1
    facet_semantic = semantic[seed]
    corners = vertices[triangles]
    # weighted towards the top: the foot of a wall may be inside another part of the building
    top = np.arange(3) == np.argmax(corners[seed][..., 2], axis=1)[:, None]
    middle = np.einsum("fc,fcj->fj", np.where(top, 0.6, 0.2), corners[seed])
    crossings = RayCrossingCounter(corners, facet)
    odd = np.stack([crossings.has_odd_crossings(middle, s * normal, np.arange(count)) for s in (1.0, -1.0)], axis=1)
    leaning = (
        (facet_semantic != _ROOF)
        & (facet_semantic != _CEILING)
        & (facet_semantic != _UNKNOWN)
        & (facet_semantic != _GROUND)
    )
    upright = np.abs(normal[:, 2]) < np.where(leaning, FACETS.max_leaning_nz, FACETS.max_upright_nz)
    low = np.full(count, np.inf)
    np.minimum.at(low, facet, corners[..., 2].min(axis=1))
    low -= vertices[:, 2].min() if len(vertices) else 0.0

    outward = _orient_outward(normal, middle, odd, upright, facet_semantic, low, size, footprint, closed, crossings)
    kind = _chart_kinds(facet_semantic, outward, upright, low)
    keep = (kind >= 0) & (size / 2 >= FACETS.min_facet_m2)
    number = np.cumsum(keep) - 1
    mine = np.flatnonzero(keep[facet])
    mine = mine[np.argsort(facet[mine], kind="stable")]
    flip = np.einsum("ij,ij->i", area[mine], outward[facet[mine]]) < 0
    corner = np.where(flip[:, None], [0, 2, 1], [0, 1, 2])
    return Facets(
        vertices=vertices,
        triangles=np.take_along_axis(triangles[mine], corner, axis=1),
        facet=number[facet[mine]],
        texture=texture[mine],
        uv=np.take_along_axis(uv[mine], corner[..., None], axis=1),
        kind=kind[keep].astype(np.uint8),
        normal=outward[keep],
    )


def _weld(shell: BuildingShell) -> tuple[Float64Array, Int64Array, Float64Array, Int64Array]:
    """Merge vertices and drop degenerate and repeated triangles, keeping textured ones.

    Returns vertices, triangles, doubled area vectors, and the kept rows of the shell.
    """
    cell = np.round(np.asarray(shell.vertices) / FACETS.weld_m).astype(np.int64)
    order = np.lexsort(cell.T)
    new = np.concatenate([[True], (np.diff(cell[order], axis=0) != 0).any(axis=1)]) if len(cell) else np.empty(0, bool)
    weld = np.empty(len(cell), np.int64)
    weld[order] = np.cumsum(new) - 1
    vertices = shell.vertices[order[new]].astype(np.float64)
    triangles = weld[shell.triangles]
    corner = np.sort(triangles, axis=1)
    first = np.lexsort((shell.texture < 0, *corner.T))
    repeat = np.zeros(len(corner), bool)
    repeat[first[1:]] = (np.diff(corner[first], axis=0) == 0).all(axis=1)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    area = np.cross(b - a, c - a)
    kept = np.flatnonzero(~repeat & (np.linalg.norm(area, axis=1) > 1e-9))
    return vertices, triangles[kept], area[kept], kept


def line_share_with_walls(facets: Facets, line: shapely.Geometry, *, foot: float = 2.0, near: float = 0.3) -> float:
    """Return the share of a line's length that walls follow; 1 for an empty line.

    Parameters
    ----------
    line : line seen from above.
    foot : metres above the lowest point of the shell down to which walls must reach.
    near : metres from the line to its walls.
    """
    length = line.length
    corners = facets.vertices[facets.triangles]
    upright = np.abs(facets.normal[facets.facet, 2]) < 0.5
    standing = corners[upright & (corners[..., 2].min(axis=1) < facets.vertices[:, 2].min() + foot)]
    if length < 1.0 or len(standing) == 0:
        return float(length < 1.0)
    walls = shapely.STRtree(shapely.linestrings(standing[..., :2]))
    parts = shapely.get_parts(line)
    steps = [np.arange(0.25, part.length, 0.5) for part in parts]
    points = shapely.line_interpolate_point(np.repeat(parts, list(map(len, steps))), np.concatenate(steps))
    return len(np.unique(walls.query(points, predicate="dwithin", distance=near)[0])) / max(1, len(points))


def _orient_outward(
    normal: Float64Array,
    middle: Float64Array,
    odd: BoolArray,
    upright: BoolArray,
    facet_semantic: Int64Array,
    low: Float64Array,
    size: Float64Array,
    footprint: Polygon | MultiPolygon,
    closed: bool,
    crossings: RayCrossingCounter,
) -> Float64Array:
    """Orient normals outward; odd (f, 2): whether the surfaces in front of and behind a facet are odd in number."""
    ahead, behind = odd.T
    # upright facets: by the footprint, then by the number of surfaces on either side
    flat = normal[:, :2] / np.maximum(np.hypot(normal[:, 0], normal[:, 1]), 1e-9)[:, None]
    aside = FACETS.side_probe_m * np.column_stack([flat, np.zeros(len(flat))])
    shapely.prepare(footprint)
    inside = [shapely.contains_xy(footprint, (middle + s * aside)[:, :2]) for s in (1, -1)]
    on_outline = upright & (inside[0] != inside[1])
    # a wall above the roof behind it belongs to the neighbour, and faces this building's side of the outline
    within = middle + np.where(inside[0], 1, -1)[:, None] * aside
    nothing = np.full(len(normal), -1)
    roofed = crossings.has_odd_crossings(within, np.tile([0.0, 0.0, 1.0], (len(normal), 1)), nothing)
    if (on_outline & roofed).any():
        decided = np.where(on_outline, roofed, upright & (ahead != behind))
    else:
        decided = on_outline | (upright & (ahead != behind))
    flip = np.where(on_outline, inside[0], ahead) & decided
    # where most decided walls are wound the wrong way round, the undecided ones are too
    reverse = size[flip].sum() > size[decided & ~flip].sum()
    # level facets face up, unless the evidence for down is stronger
    winds_down = (normal[:, 2] < 0) != reverse
    above = np.where(normal[:, 2] > 0, ahead, behind)
    below = np.where(normal[:, 2] > 0, behind, ahead)
    down = np.where(closed, above & ~below, winds_down & (above | (low < FACETS.underside_m)))
    down = np.where(above & below, winds_down, down)
    down = np.where(facet_semantic == _CEILING, True, np.where((facet_semantic == _ROOF) & (not closed), False, down))
    flip = np.where(upright, np.where(decided, flip, reverse), (normal[:, 2] < 0) != down)
    return np.where(flip[:, None], -normal, normal)


def _chart_kinds(
    facet_semantic: Int64Array, outward: Float64Array, upright: BoolArray, low: Float64Array
) -> Int64Array:
    """Return the chart kinds (f,) of facets, by semantic, else by slope and place; -1 for the underside.

    What stands upright is a wall, also where its source calls it a roof.
    """
    level = np.where(outward[:, 2] > 0, ChartKind.ROOF, np.where(low < FACETS.underside_m, -1, ChartKind.CEILING))
    decided = np.array([_KIND_OF_SEMANTIC.get(name, -1) for name in SEMANTICS])[facet_semantic]
    kind = np.where(
        (facet_semantic == _UNKNOWN) | (facet_semantic == _WALL), np.where(upright, ChartKind.WALL, level), decided
    )
    is_roof = facet_semantic == _ROOF
    kind = np.where(is_roof & upright, ChartKind.WALL, kind)
    return np.where(is_roof & ~upright & (outward[:, 2] < 0), ChartKind.CEILING, kind)


@njit(cache=True)
def _grow_facets(
    vertices: Float64Array,
    triangles: Int64Array,
    label: Int64Array,
    normal: Float64Array,
    area: Float64Array,
    order: Int64Array,
    key: Int64Array,
    by_edge: Int64Array,
) -> tuple[Int64Array, Int64Array, bool]:
    """Grow facets over shared edges from seeds in `order`.

    area (t,) is the doubled area of triangles; key (3 t,) identifies the undirected edge from each corner, and by_edge
    (3 t,) sorts the corners by it. Returns the facet of each triangle, the seed of each facet, and whether the surface
    is closed.
    """
    t = len(triangles)
    edge = np.empty(3 * t, np.int64)
    start = np.empty(3 * t + 1, np.int64)
    edges = 0
    closed = True
    for j in range(3 * t):
        if j == 0 or key[by_edge[j]] != key[by_edge[j - 1]]:
            if j > 0 and (j - start[edges - 1]) % 2 == 1:
                closed = False
            start[edges] = j
            edges += 1
        edge[by_edge[j]] = edges - 1
    start[edges] = 3 * t
    if t > 0 and (3 * t - start[edges - 1]) % 2 == 1:
        closed = False

    facet = np.full(t, -1, np.int64)
    seeds = np.empty(t, np.int64)
    stack = np.empty(t, np.int64)
    count = 0
    for seed in order:
        if facet[seed] >= 0:
            continue
        n0 = normal[seed]
        p0 = (vertices[triangles[seed, 0]] + vertices[triangles[seed, 1]] + vertices[triangles[seed, 2]]) / 3
        seeds[count] = seed
        facet[seed] = count
        stack[0] = seed
        depth = 1
        while depth > 0:
            depth -= 1
            i = stack[depth]
            for k in range(3):
                e = edge[3 * i + k]
                for j in range(start[e], start[e + 1]):
                    s = by_edge[j] // 3
                    if facet[s] >= 0 or label[s] != label[seed]:
                        continue
                    longest = 0.0
                    off = 0.0
                    cosine = 0.0
                    for c in range(3):
                        p, q = triangles[s, c], triangles[s, (c + 1) % 3]
                        edge_length = 0.0
                        height = 0.0
                        for m in range(3):
                            edge_length += (vertices[p, m] - vertices[q, m]) ** 2
                            height += (vertices[p, m] - p0[m]) * n0[m]
                        longest = max(longest, edge_length)
                        off = max(off, abs(height))
                        cosine += normal[s, c] * n0[c]
                    longest = np.sqrt(longest)
                    cosine = abs(cosine)
                    doubt = VERTEX_ACCURACY_M * longest / area[s]
                    if off <= MAX_OFF_PLANE_M and (cosine >= MIN_NORMAL_COSINE or 1 - cosine * cosine <= doubt * doubt):
                        facet[s] = count
                        stack[depth] = s
                        depth += 1
        count += 1
    return facet, seeds[:count], closed
