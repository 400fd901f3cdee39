"""Closed shells of pitched roofs, from planes over a rectangle or from the straight skeleton of the outline."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import shapely
from scipy.spatial import KDTree
from shapely import LineString, MultiPolygon, Polygon

from facade_core.core.arrays import Float64Array, ObjectArray
from facade_core.core.errors import GeometryError
from facade_core.core.fixed_order import dot_product, multiply_matrices
from facade_core.core.types import SEMANTICS, Building, BuildingShell, Roof
from facade_core.geometry.buildings import straight_skeleton
from facade_core.geometry.buildings.settings import ROOF_SHAPES, SKELETON

# Shapes that rise from all edges of a footprint that is no rectangle, or has neighbours.
SKELETON_SHAPES = ("gabled", "hipped", "mansard", "gambrel")

# Semantic of gables, so that they do not join the wall below; their slope makes them walls.
GABLE_SEMANTIC = "unknown"

RoofHeight = Callable[[Float64Array], Float64Array]


def build_shell_with_roof(
    building: Building, base: float, adjoining: Sequence[Polygon | MultiPolygon] = ()
) -> BuildingShell | None:
    """Build the closed shell of a building with a pitched roof.

    Shapes as in OpenStreetMap: gabled, hipped, half-hipped, pyramidal, skillion (shed), gambrel, mansard. The roof is
    the lowest of planes from the sides of the footprint's smallest rectangle, a skillion's from its lowest corner;
    walls reach up to it. Over another footprint SKELETON_SHAPES rise from all edges but gable sides, and continue over
    adjoining footprints, so that the ridge passes through party walls. Where the skeleton fails, the rectangle's planes
    are used, or with a known pitch none.

    Parameters
    ----------
    base : ground height in metres.
    adjoining : footprints that the roof continues over.

    Returns
    -------
    None where the roof is flat or of an unknown shape.
    """
    roof = building.roof
    if roof is None or not roof.height > 0:
        return None
    footprint = shapely.set_precision(building.footprint, ROOF_SHAPES.grid_m)
    if footprint.geom_type != "Polygon" or footprint.is_empty:
        return None
    eaves = base + building.height
    rectangular = footprint.area >= ROOF_SHAPES.min_rectangle_fill * shapely.minimum_rotated_rectangle(footprint).area
    if roof.shape in SKELETON_SHAPES and not roof.across and (roof.pitch or adjoining or not rectangular):
        try:
            return _shell(*_skeleton_regions(roof, footprint, adjoining), footprint, base, eaves)
        except (GeometryError, shapely.errors.GEOSException):
            if roof.pitch:
                return None
    centre = np.asarray(footprint.centroid.coords[0])
    planes = _rectangle_planes(roof, shapely.get_coordinates(footprint) - centre, footprint, centre)
    if planes is None:
        return None

    def rise(xy: Float64Array) -> Float64Array:
        rise: Float64Array = np.maximum(
            (multiply_matrices(xy - centre, planes[:, :2].T) + planes[:, 2]).min(axis=1), 0.0
        )
        return rise

    return _shell(_plane_regions(footprint, planes, centre), rise, footprint, base, eaves)


def _skeleton_regions(
    roof: Roof, footprint: Polygon, adjoining: Sequence[Polygon | MultiPolygon]
) -> tuple[ObjectArray, RoofHeight]:
    """Return the regions of a roof by the straight skeleton, and its height over the eaves as a function."""
    runs, rises = _roof_profile(roof)
    reach = runs[-1] if runs is not None else ROOF_SHAPES.neighbour_reach_m
    outline = _common_outline(footprint, adjoining, 1.5 * reach)
    if roof.shape in ("gabled", "gambrel"):
        outline = _extend_gables(outline, footprint)
    slabs = straight_skeleton.edge_slabs(outline)
    if runs is None:
        runs = (
            np.array([0.0, 1.0])
            if roof.shape in ("gabled", "hipped")
            else np.array([0.0, ROOF_SHAPES.steep_run_share, 1.0])
        )
        faces = slabs.faces(4 * reach)
        corners = shapely.get_coordinates(shapely.intersection(faces, footprint))
        runs = runs * slabs.depth(corners).max(initial=0.0)
    else:
        faces = slabs.faces(float(runs[-1]) + 1.0)
    if not runs[-1] > 0:
        raise GeometryError("a roof has no slope")
    contours = np.concatenate([slabs.contours(faces, run) for run in runs[1:]])
    lines = shapely.union_all([*shapely.boundary(faces), *contours], grid_size=SKELETON.grid_m)
    lines = shapely.intersection(lines, footprint.buffer(1.0))
    noded = shapely.union_all([footprint.boundary, lines], grid_size=ROOF_SHAPES.grid_m)
    regions = shapely.get_parts(shapely.polygonize(shapely.get_parts(noded)))
    regions = regions[shapely.contains(footprint, shapely.point_on_surface(regions))]
    if abs(shapely.area(regions).sum() - footprint.area) > 1e-3 * footprint.area:
        raise GeometryError("a roof leaves a part of its footprint open")

    def rise(xy: Float64Array) -> Float64Array:
        points = shapely.points(xy)
        # eaves are level: points of the footprint within a jog of the outline are at the eaves
        level = shapely.distance(points, outline.boundary) <= ROOF_SHAPES.max_jog_m
        level[level] = shapely.distance(points[level], footprint.boundary) < ROOF_SHAPES.grid_m
        return np.where(level, 0.0, np.interp(slabs.depth(xy), runs, rises))

    return regions, rise


def _roof_profile(roof: Roof) -> tuple[Float64Array | None, Float64Array]:
    """Return depths (k,) inside the outline and heights (k,) over the eaves, metres; depths are None without a pitch."""
    broken = roof.shape in ("mansard", "gambrel")
    rises = roof.height * (np.array([0.0, ROOF_SHAPES.steep_rise_share, 1.0]) if broken else np.array([0.0, 1.0]))
    if roof.pitch is None:
        return None, rises
    slopes = np.tan(np.radians([roof.pitch, ROOF_SHAPES.upper_pitch_deg] if broken else [roof.pitch]))
    return np.cumsum([0.0, *(np.diff(rises) / slopes)]), rises


def _common_outline(footprint: Polygon, adjoining: Sequence[Polygon | MultiPolygon], reach: float) -> Polygon:
    """Return the outline of one roof: a footprint and the near parts of its neighbours, without small jogs."""
    party = [other for other in adjoining if _shared_length(footprint, other) >= ROOF_SHAPES.min_shared_m]
    closed = shapely.union_all([footprint])
    if party:
        near = footprint.buffer(reach, quad_segs=2)
        covered = shapely.union_all([footprint, *(shapely.intersection(other, near) for other in party)])
        closed = covered.buffer(ROOF_SHAPES.max_gap_m, join_style="mitre").buffer(
            -ROOF_SHAPES.max_gap_m, join_style="mitre"
        )
    smooth = closed.simplify(ROOF_SHAPES.max_jog_m)
    found = [part for part in shapely.get_parts(smooth) if part.intersects(footprint.representative_point())]
    if len(found) != 1 or found[0].geom_type != "Polygon" or not found[0].is_valid:
        raise GeometryError("a footprint falls apart")
    rings = [ring for ring in found[0].interiors if Polygon(ring).area > (2 * ROOF_SHAPES.max_jog_m) ** 2]
    return Polygon(found[0].exterior, rings)


def _shared_length(one: Polygon, other: Polygon | MultiPolygon) -> float:
    """Return the metres of outline that two footprints share."""
    return float(one.boundary.intersection(other.buffer(ROOF_SHAPES.max_gap_m)).length)


def _extend_gables(outline: Polygon, footprint: Polygon) -> Polygon:
    """Extend an outline beyond the free end sides of wings, so that the ridge reaches them."""
    ring = np.asarray(shapely.orient_polygons(outline).exterior.coords)[:-1]
    ahead = np.roll(ring, -1, axis=0) - ring
    length = np.hypot(*ahead.T)
    along = ahead / length[:, None]
    # counter-clockwise: a left turn is convex
    turn = np.einsum("ij,ij->i", np.roll(along, 1, axis=0), along)
    convex = np.roll(along, 1, axis=0)[:, 0] * along[:, 1] - np.roll(along, 1, axis=0)[:, 1] * along[:, 0] > 0
    square = convex & (np.abs(turn) < ROOF_SHAPES.max_square_cosine)
    shorter = np.minimum(np.roll(length, 1), np.roll(length, -1))
    ends = np.flatnonzero(square & np.roll(square, -1) & (length < ROOF_SHAPES.max_gable_side_m) & (length < shorter))
    drawn_out = outline
    for edge in ends:
        a, b = ring[edge], ring[(edge + 1) % len(ring)]
        if footprint.boundary.distance(shapely.Point((a + b) / 2)) > ROOF_SHAPES.max_jog_m:
            continue
        out = ROOF_SHAPES.gable_extension * length[edge] * np.array([along[edge, 1], -along[edge, 0]])
        # the adjacent sides are extended in their own directions, so that their slopes continue
        left, right = (
            way * dot_product(out, out) / dot_product(way, out)
            for way in (along[edge - 1], along[(edge + 1) % len(ring)])
        )
        added = Polygon([a, b, b + right, a + left])
        if added.is_valid and outline.intersection(added).area < 1e-3:
            grown = shapely.union_all([drawn_out, added], grid_size=ROOF_SHAPES.grid_m)
            drawn_out = grown if grown.geom_type == "Polygon" else drawn_out
    return drawn_out


def _rectangle_planes(
    roof: Roof, corners: Float64Array, footprint: Polygon, centre: Float64Array
) -> Float64Array | None:
    """Return planes (k, 3): height over the eaves = a x + b y + c, from the centre; None for an unknown shape."""
    height = roof.height
    along, across, half_along, half_across, middle = _rectangle(footprint, centre, roof.across)
    if roof.shape in ("skillion", "shed"):
        fall = (
            across
            if roof.direction is None
            else np.array([np.sin(np.radians(roof.direction)), np.cos(np.radians(roof.direction))])
        )
        reach = multiply_matrices(corners, fall)
        single_plane: Float64Array = np.array([[*(-fall), reach.max()]]) * height / np.ptp(reach)
        return single_plane

    def side(normal: Float64Array, half: float, rise: float, run: float, start: float = 0.0) -> Float64Array:
        """Return the plane over the side towards `normal`: `start` at the side, `rise` more after `run` metres inwards."""
        slope = rise / run
        return np.array([*(-slope * normal), start + slope * (half + dot_product(middle, normal))])

    eaves = [(across, half_across, half_across), (-across, half_across, half_across)]
    # hips are as steep as the sides, but leave a ridge on a roof across
    run = half_across if half_across <= half_along else half_along / 2
    hips = [(along, half_along, run), (-along, half_along, run)]
    match roof.shape:
        case "gabled":
            planes = [side(n, half, height, r) for n, half, r in eaves]
        case "hipped":
            planes = [side(n, half, height, r) for n, half, r in eaves + hips]
        case "half-hipped":
            planes = [side(n, half, height, r) for n, half, r in eaves]
            planes += [side(n, half, height, r, ROOF_SHAPES.half_hip_share * height) for n, half, r in hips]
        case "pyramidal":
            planes = [side(n, half, height, half) for n, half, _ in eaves + hips]
        case "gambrel" | "mansard":
            sides = eaves if roof.shape == "gambrel" else eaves + hips
            steep, left = ROOF_SHAPES.steep_rise_share * height, (1 - ROOF_SHAPES.steep_rise_share) * height
            planes = [side(n, half, steep, ROOF_SHAPES.steep_run_share * r) for n, half, r in sides]
            planes += [
                side(n, half - ROOF_SHAPES.steep_run_share * r, left, (1 - ROOF_SHAPES.steep_run_share) * r, steep)
                for n, half, r in sides
            ]
        case _:
            return None
    return np.array(planes)


def _rectangle(
    footprint: Polygon, centre: Float64Array, turned: bool
) -> tuple[Float64Array, Float64Array, float, float, Float64Array]:
    """Return unit vectors along and across the ridge, half the sizes of the rectangle that way, and its middle."""
    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(footprint))[:4] - centre
    sides = corners[1:3] - corners[:2]
    length = np.hypot(*sides.T)
    # of equal sides the first is parallel to the ridge, independent of rounding
    first = 0 if length[0] >= length[1] - ROOF_SHAPES.grid_m else 1
    along, across = (sides / length[:, None])[[first, 1 - first]]
    half_along, half_across = length[[first, 1 - first]] / 2
    if turned:
        along, across, half_along, half_across = across, along, half_across, half_along
    return along, across, float(half_along), float(half_across), corners.mean(axis=0)


def _shell(regions: ObjectArray, rise: RoofHeight, footprint: Polygon, base: float, eaves: float) -> BuildingShell:
    """Build the closed shell between the base and a roof, given by the regions of its planes and its height."""
    cut = shapely.get_parts(shapely.constrained_delaunay_triangles(regions))
    corners = shapely.get_coordinates(shapely.orient_polygons(cut)).reshape(-1, 4, 2)[:, :3]
    welded = _weld_to_corners(corners.reshape(-1, 2), shapely.get_coordinates(footprint))
    points, index = np.unique(welded, axis=0, return_inverse=True)
    top = index.reshape(-1, 3)
    top = top[(top != np.roll(top, 1, axis=1)).all(axis=1)]
    count = len(points)
    edges = np.concatenate([top[:, [0, 1]], top[:, [1, 2]], top[:, [2, 0]]])
    key, reverse = edges @ [count, 1], edges @ [1, count]
    a, b = edges[~np.isin(key, reverse)].T  # the outline: edges that no other triangle runs back along
    risen = rise(points)
    risen[risen < ROOF_SHAPES.grid_m] = 0.0
    # walls end at the eaves; above them, the gables reach up to the roof
    raised = risen > 0
    low_a, low_b = a + 2 * count * raised[a], b + 2 * count * raised[b]
    walls = np.concatenate(
        [np.stack([a + count, b + count, low_b], axis=1), np.stack([a + count, low_b, low_a], axis=1)]
    )
    one, other = raised[b], raised[a]
    gables = np.concatenate([np.stack([low_a, low_b, b], axis=1)[one], np.stack([low_a, b, a], axis=1)[other]])
    triangles = np.concatenate([top, top[:, ::-1] + count, walls, gables])
    parts = (("roof", top), ("ground", top), ("wall", walls), (GABLE_SEMANTIC, gables))
    semantic = np.repeat([SEMANTICS.index(name) for name, _ in parts], [len(part) for _, part in parts])
    heights = np.concatenate([eaves + risen, np.full(count, base), np.full(count, eaves)])
    return BuildingShell(
        vertices=np.column_stack([np.tile(points, (3, 1)), heights]),
        triangles=triangles.astype(np.int32),
        semantic=semantic.astype(np.uint8),
        texture=np.full(len(triangles), -1, np.int32),
        uv=np.zeros((len(triangles), 3, 2), np.float32),
    )


def _weld_to_corners(points: Float64Array, corners: Float64Array) -> Float64Array:
    """Return points (n, 2), moved to a corner (k, 2) of the outline within `weld_m`."""
    distance, nearest = KDTree(corners).query(points, distance_upper_bound=ROOF_SHAPES.weld_m)
    near = np.isfinite(distance)
    welded = points.copy()
    welded[near] = corners[nearest[near]]
    return welded


def _plane_regions(footprint: Polygon, planes: Float64Array, centre: Float64Array) -> ObjectArray:
    """Cut the footprint into the regions of the lowest planes, with shared corners."""
    reach = 2 * footprint.length
    ridges = [_ridge(planes, i, j, reach) for i in range(len(planes)) for j in range(i)]
    lines = [footprint.boundary, *(LineString(ridge + centre) for ridge in ridges if ridge is not None)]
    noded = shapely.union_all(lines, grid_size=ROOF_SHAPES.grid_m)
    faces = shapely.get_parts(shapely.polygonize(shapely.get_parts(noded)))
    regions: ObjectArray = faces[shapely.contains(footprint, shapely.point_on_surface(faces))]
    return regions


def _ridge(planes: Float64Array, i: int, j: int, reach: float) -> Float64Array | None:
    """Return the segment (2, 2) on which planes i and j are the lowest, up to `reach` from the centre; None without."""
    difference = planes[i] - planes[j]
    size = np.hypot(*difference[:2])
    if size < 1e-9:
        return None
    normal = difference[:2] / size
    foot, ahead = -normal * difference[2] / size, np.array([-normal[1], normal[0]])
    # every other plane is above at foot + t ahead where start + t slope >= 0
    others = np.delete(planes, [i, j], axis=0) - planes[i]
    start, slope = multiply_matrices(others[:, :2], foot) + others[:, 2], multiply_matrices(others[:, :2], ahead)
    if (start[np.abs(slope) < 1e-9] < -1e-9).any():
        return None
    grows, falls = slope >= 1e-9, slope <= -1e-9
    low = np.max(-start[grows] / slope[grows], initial=-reach)
    high = np.min(-start[falls] / slope[falls], initial=reach)
    return np.array([foot + low * ahead, foot + high * ahead]) if high - low > ROOF_SHAPES.grid_m else None
