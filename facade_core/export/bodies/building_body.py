"""Closed body of a building down to a level ground, and its attachments."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from facade_core.core.arrays import BoolArray, Float64Array, IntArray
from facade_core.export.bodies.footprints import building_footprint
from facade_core.export.bodies.openings import chart_outlines
from facade_core.export.bodies.patches import (
    MeshPolygon,
    PolygonMesh,
    count_edges,
    is_closed,
    open_edges,
    plane_axes,
    polygon_components,
    ring_area_vector,
    split_edges_at_corners,
    trace_loops,
    triangulate_nonplanar_polygons,
    weld_polygons,
)
from facade_core.export.bodies.settings import BODIES
from facade_core.export.models.textured_mesh import TexturedMesh
from facade_core.geometry.buildings.curtains import curtains_below_edges
from facade_core.geometry.charts import ChartKind


@dataclass(frozen=True)
class BuildingBody:
    """Body of a building with its attachments.

    Attributes
    ----------
    shell : polygons of the body; of the whole building if it cannot be closed.
    is_closed : True if the shell is watertight.
    attachments : connected pieces outside of the body.
    """

    shell: PolygonMesh
    is_closed: bool
    attachments: tuple[PolygonMesh, ...]


def build_body(
    source: TexturedMesh, triangles: IntArray, chart_surfaces: dict[int, int], ground_surface: int, origin: Float64Array
) -> BuildingBody:
    """Build the body of one building.

    Roof parts beyond the walls, and pieces on or next to the body (parapets, chimneys, dormers), become attachments.

    Parameters
    ----------
    source : textured mesh.
    triangles : (t,) triangles of the building.
    chart_surfaces : semantic surface of each chart.
    ground_surface : semantic surface that closes the body at its lowest corner.
    origin : (3,) origin of the grid of corners, world metres.
    """
    standing = shapely.union_all(building_footprint(source, triangles)).buffer(BODIES.wall_margin_m, join_style="mitre")
    corners = source.mesh.vertices[source.mesh.triangles[triangles]].reshape(-1, 3)
    out = ~shapely.contains_xy(standing, *corners[:, :2].T).reshape(-1, 3).all(axis=1)
    found = []
    for apart in (out, np.zeros(len(out), bool)) if out.any() else (out,):
        whole = _chart_polygons(source, triangles, apart, chart_surfaces, origin)
        for peel in (False, True):
            tried = _close_shell(whole, ground_surface, origin, peel)
            if tried is not None:
                found.append(tried)
                break
        if found:
            break
    if not found:
        return BuildingBody(triangulate_nonplanar_polygons(whole), False, ())
    _, shell, left = min(found, key=lambda one: one[0])
    attachments = left.patches
    return BuildingBody(
        shell,
        True,
        tuple(triangulate_nonplanar_polygons(left.subset(piece)) for piece in polygon_components(attachments)),
    )


def _chart_polygons(
    source: TexturedMesh, triangles: IntArray, apart: BoolArray, chart_surfaces: dict[int, int], origin: Float64Array
) -> PolygonMesh:
    """Return the charts of a building as polygons; triangles in `apart` (t,) bool form polygons of their own."""
    charts, mesh = source.charts, source.mesh
    polygons, of = [], []
    chart_of = mesh.chart[triangles]
    for chart in np.unique(chart_of).tolist():
        for side in (False, True):
            own = mesh.triangles[triangles[(chart_of == chart) & (apart == side)]]
            if charts.kind[chart] == ChartKind.METAL:  # metal sheets are curved: their triangles stay separate
                polygons += [[corners] for corners in mesh.vertices[own]]
                of += [chart] * len(own)
                continue
            corners = np.unique(own)
            known = dict(zip(map(tuple, source.coordinates[corners].tolist()), corners.tolist(), strict=True))
            for part in chart_outlines(source.coordinates[own]):
                rings = []
                for ring in (part.exterior, *part.interiors):
                    flat = np.asarray(ring.coords)[:-1]
                    points = charts.points(chart, *flat.T)
                    for i, corner in enumerate(map(tuple, flat.tolist())):
                        if corner in known:
                            points[i] = mesh.vertices[known[corner]]
                    rings.append(points)
                polygons.append(rings)
                of.append(chart)
    return weld_polygons(polygons, of, [chart_surfaces[chart] for chart in of], origin)


def _close_shell(
    whole: PolygonMesh, ground: int, origin: Float64Array, peel: bool
) -> tuple[float, PolygonMesh, PolygonMesh] | None:
    """Close the main component of some polygons.

    Returns the area in m2 that was left out or added, the shell, and the polygons left out; None if it cannot be closed. With
    `peel`, polygons with open edges above the foot are left out.
    """
    main = _largest_component(whole, range(len(whole.patches)))
    if not main:
        return None
    whole, main = _close_small_holes(whole, main)
    peeled = _peel_open_patches(whole, main) if peel else main
    if _total_area(whole, peeled) < BODIES.min_area_share * _total_area(whole, main):
        return None
    kept = _largest_component(whole, peeled) if peel else peeled
    shell = split_edges_at_corners(whole.subset(kept))
    covers = _cover_open_loops(_add_curtains(shell, origin), ground)
    if covers is None:
        return None
    done = triangulate_nonplanar_polygons(_collapse_pinched_edges(triangulate_nonplanar_polygons(covers)))
    if not is_closed(done.patches):
        return None
    added, added_level = _added_areas(done, ground)
    if added_level > BODIES.max_added_area_share * _total_area(whole, kept):
        return None
    left = [i for i in sorted(set(range(len(whole.patches))) - set(kept)) if whole.patches[i].chart >= 0]
    return added + _total_area(whole, left), done, whole.subset(left)


def _added_areas(shell: PolygonMesh, ground: int) -> tuple[float, float]:
    """Return the area that closing added above the ground, and its horizontal part, m2."""
    added = [shell.area_vector(patch) for patch in shell.patches if patch.chart < 0 and patch.semantic != ground]
    return sum(float(np.linalg.norm(one)) for one in added), sum(abs(float(one[2])) for one in added)


def _total_area(whole: PolygonMesh, chosen: Iterable[int]) -> float:
    """Return the area of the chosen polygons, m2."""
    return sum(float(np.linalg.norm(whole.area_vector(whole.patches[i]))) for i in chosen)


def _largest_component(whole: PolygonMesh, chosen: Sequence[int]) -> list[int]:
    """Return the connected component of the chosen polygons with the largest area; empty without any."""
    components = polygon_components([whole.patches[i] for i in chosen])
    members = [[chosen[i] for i in component] for component in components]
    return max(members, key=lambda own: _total_area(whole, own), default=[])


def _lowest_corner(mesh: PolygonMesh) -> float:
    """Return the height of the lowest corner of the polygons; 0 without any."""
    return float(min((mesh.points[c, 2] for patch in mesh.patches for ring in patch.rings for c in ring), default=0.0))


def _add_curtains(shell: PolygonMesh, origin: Float64Array) -> PolygonMesh:
    """Add walls from open edges down to the lowest corner of a shell."""
    base = _lowest_corner(shell)
    edges = [(shell.points[b], shell.points[a]) for a, b in open_edges(shell.patches)]
    polygons = [curtain.rings() for curtain in curtains_below_edges(edges, base)]
    if not polygons:
        return shell
    before = [patch.ring_points(shell.points) for patch in shell.patches]
    charts = [patch.chart for patch in shell.patches] + [-1] * len(polygons)
    semantics = [patch.semantic for patch in shell.patches] + [-1] * len(polygons)
    return weld_polygons([*before, *polygons], charts, semantics, origin)


def _close_small_holes(whole: PolygonMesh, main: Sequence[int]) -> tuple[PolygonMesh, list[int]]:
    """Close the small holes of the main component; returns the polygons and the main component with the new ones."""
    chosen = whole.subset(main)
    rings = []
    for ring in trace_loops([(b, a) for a, b in open_edges(chosen.patches)]):
        points = whole.points[list(ring)]
        if np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1).sum() < BODIES.max_hole_perimeter_m:
            rings.append(MeshPolygon((ring,)))
    return PolygonMesh(whole.points, (*whole.patches, *rings)), [
        *main,
        *range(len(whole.patches), len(whole.patches) + len(rings)),
    ]


def _collapse_pinched_edges(shell: PolygonMesh) -> PolygonMesh:
    """Collapse short edges at which more than two polygons meet."""
    count = count_edges(shell.patches)
    to: dict[int, int] = {}
    for (a, b), n in sorted(count.items()):
        if n > 1 and a < b and np.linalg.norm(shell.points[a] - shell.points[b]) < BODIES.max_hole_perimeter_m / 2:
            to[b] = to.get(a, a)
    if not to:
        return shell
    moved = [replace(p, rings=tuple(tuple(to.get(c, c) for c in ring) for ring in p.rings)) for p in shell.patches]
    return split_edges_at_corners(PolygonMesh(shell.points, tuple(moved)))


def _peel_open_patches(whole: PolygonMesh, chosen: Sequence[int]) -> list[int]:
    """Remove patches with an edge open above the foot until none is left."""
    low = _lowest_corner(whole.subset(chosen)) + BODIES.max_foot_height_m
    kept = list(chosen)
    while True:
        there = {edge for i in kept for edge in whole.patches[i].edges()}

        def loose(i: int, there: set[tuple[int, int]] = there) -> bool:
            return any((b, a) not in there and whole.points[[a, b], 2].max() > low for a, b in whole.patches[i].edges())

        left = [i for i in kept if not loose(i)]
        if len(left) == len(kept):
            return kept
        kept = left


def _cover_open_loops(shell: PolygonMesh, ground: int) -> PolygonMesh | None:
    """Close open loops by planar polygons, level ones at the foot as ground; None if a loop is not planar."""
    rings = trace_loops([(b, a) for a, b in open_edges(shell.patches)])
    planes: dict[tuple[int, ...], list[tuple[int, ...]]] = {}
    for ring in rings:
        points = shell.points[list(ring)]
        normal = ring_area_vector(points)
        size = float(np.linalg.norm(normal))
        if size < 1e-9 or np.abs((points - points.mean(axis=0)) @ normal).max() > BODIES.max_off_plane_m * size:
            return None
        normal = normal * np.sign(normal[np.argmax(np.abs(normal))]) / size
        # heights on the grid never fall between two bins, so rings of one level plane share a bin
        key = (*np.rint(normal * 20).astype(int).tolist(), round(float(points.mean(axis=0) @ normal) / 0.05 + 0.01))
        planes.setdefault(key, []).append(ring)
    covers: list[MeshPolygon] = []
    for own in planes.values():
        covers += _nest_rings(shell.points, own)
    low = _lowest_corner(shell)

    def name_patch(patch: MeshPolygon) -> MeshPolygon:
        down = ring_area_vector(shell.points[list(patch.rings[0])])
        level = down[2] < -0.9 * np.linalg.norm(down)
        return (
            replace(patch, semantic=ground)
            if level and shell.points[patch.rings[0][0], 2] < low + BODIES.max_foot_height_m
            else patch
        )

    return PolygonMesh(shell.points, (*shell.patches, *map(name_patch, covers)))


def _nest_rings(points: Float64Array, rings: Sequence[tuple[int, ...]]) -> list[MeshPolygon]:
    """Combine rings of one plane to polygons; rings against the largest are holes of the smallest around them."""
    areas = [ring_area_vector(points[list(ring)]) for ring in rings]
    normal = max(areas, key=lambda one: float(np.linalg.norm(one)))
    axes = plane_axes(normal / np.linalg.norm(normal))
    flat = [shapely.Polygon(points[list(ring)] @ axes.T) for ring in rings]
    outer = [i for i, area in enumerate(areas) if area @ normal > 0]
    holes: dict[int, list[tuple[int, ...]]] = defaultdict(list)
    for i in set(range(len(rings))) - set(outer):
        corner = shapely.Point(flat[i].exterior.coords[0])
        around = [k for k in outer if flat[k].buffer(BODIES.max_off_plane_m).covers(corner)]
        if around:
            holes[min(around, key=lambda k: flat[k].area)].append(rings[i])
    return [MeshPolygon((rings[i], *holes[i])) for i in outer]
