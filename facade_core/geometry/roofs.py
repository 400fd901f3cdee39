"""Roof shapes over a footprint, as closed shells: the lowest of a few planes that rise from the sides of its rectangle."""

from __future__ import annotations

import numpy as np
import shapely
from shapely import LineString, Polygon

from facade_core.types import SEMANTICS, Building, Roof, Shell

# Outlines and ridges meet on this grid, so that the regions of the roof share their corners exactly.
GRID_M = 1e-3
# Gambrel and mansard roofs: share of the way to the ridge that is steep, and of the height that is reached there.
STEEP_RUN, STEEP_RISE = 0.25, 0.6
# A half-hipped roof is a gable up to this share of its height.
HALF_HIP = 0.5


def roof_shell(building: Building, base: float) -> Shell | None:
    """A closed shell of a building with its roof, standing on `base`; None where the roof is flat or of another shape.

    Shapes as in OpenStreetMap: gabled, hipped, half-hipped, pyramidal, skillion (shed), gambrel, mansard. Planes rise from the
    sides of the footprint's smallest rectangle (a skillion's from its lowest corner), the roof is the lowest of them, and
    walls reach up to it. The footprint may have holes and need not be a rectangle.
    """
    roof = building.roof
    if roof is None or not roof.height > 0:
        return None
    footprint = shapely.set_precision(building.footprint, GRID_M)
    if footprint.geom_type != "Polygon" or footprint.is_empty:
        return None
    centre = np.asarray(footprint.centroid.coords[0])
    planes = _planes(roof, shapely.get_coordinates(footprint) - centre, footprint, centre)
    if planes is None:
        return None
    return _shell(footprint, centre, planes, base, base + building.height)


def _planes(roof: Roof, corners: np.ndarray, footprint: Polygon, centre: np.ndarray) -> np.ndarray | None:
    """Planes (k, 3): height over the eaves = a x + b y + c, x and y from the centre; None for another shape."""
    height = roof.height
    along, across, half_along, half_across, middle = _rectangle(footprint, centre, roof.across)
    if roof.shape in ("skillion", "shed"):
        fall = (
            across
            if roof.direction is None
            else np.array([np.sin(np.radians(roof.direction)), np.cos(np.radians(roof.direction))])
        )
        reach = corners @ fall
        return np.array([[*(-fall), reach.max()]]) * height / np.ptp(reach)

    def side(normal: np.ndarray, half: float, rise: float, run: float, start: float = 0.0) -> np.ndarray:
        """The plane over the side towards `normal`: `start` at the side, `rise` more after `run` metres inwards."""
        slope = rise / run
        return np.array([*(-slope * normal), start + slope * (half + middle @ normal)])

    eaves = [(across, half_across, half_across), (-across, half_across, half_across)]
    # hips are as steep as the sides, but never eat up the whole ridge of a roof across
    run = half_across if half_across <= half_along else half_along / 2
    hips = [(along, half_along, run), (-along, half_along, run)]
    match roof.shape:
        case "gabled":
            planes = [side(n, half, height, r) for n, half, r in eaves]
        case "hipped":
            planes = [side(n, half, height, r) for n, half, r in eaves + hips]
        case "half-hipped":
            planes = [side(n, half, height, r) for n, half, r in eaves]
            planes += [side(n, half, height, r, HALF_HIP * height) for n, half, r in hips]
        case "pyramidal":
            planes = [side(n, half, height, half) for n, half, _ in eaves + hips]
        case "gambrel" | "mansard":
            sides = eaves if roof.shape == "gambrel" else eaves + hips
            steep, left = STEEP_RISE * height, (1 - STEEP_RISE) * height
            planes = [side(n, half, steep, STEEP_RUN * r) for n, half, r in sides]
            planes += [side(n, half - STEEP_RUN * r, left, (1 - STEEP_RUN) * r, steep) for n, half, r in sides]
        case _:
            return None
    return np.array(planes)


def _rectangle(
    footprint: Polygon, centre: np.ndarray, turned: bool
) -> tuple[np.ndarray, np.ndarray, float, float, np.ndarray]:
    """Unit vectors along and across the ridge, half the rectangle's size that way, and its middle from the centre."""
    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(footprint))[:4] - centre
    sides = corners[1:3] - corners[:2]
    length = np.hypot(*sides.T)
    # equal sides: the first is the ridge's, whatever the last digit says
    first = 0 if length[0] >= length[1] - GRID_M else 1
    along, across = (sides / length[:, None])[[first, 1 - first]]
    half_along, half_across = length[[first, 1 - first]] / 2
    if turned:
        along, across, half_along, half_across = across, along, half_across, half_along
    return along, across, float(half_along), float(half_across), corners.mean(axis=0)


def _shell(footprint: Polygon, centre: np.ndarray, planes: np.ndarray, base: float, eaves: float) -> Shell:
    """The closed shell between the base and the lowest of the planes."""

    def rise(xy: np.ndarray) -> np.ndarray:
        return np.maximum(((xy - centre) @ planes[:, :2].T + planes[:, 2]).min(axis=1), 0.0)

    regions = _regions(footprint, planes, centre)
    cut = shapely.get_parts(shapely.constrained_delaunay_triangles(regions))
    corners = shapely.get_coordinates(shapely.orient_polygons(cut)).reshape(-1, 4, 2)[:, :3]
    points, index = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    top = index.reshape(-1, 3)
    count = len(points)
    edges = np.concatenate([top[:, [0, 1]], top[:, [1, 2]], top[:, [2, 0]]])
    key, reverse = edges @ [count, 1], edges @ [1, count]
    a, b = edges[~np.isin(key, reverse)].T  # the outline: edges that no other triangle runs back along
    walls = np.concatenate([np.stack([a + count, b + count, b], axis=1), np.stack([a + count, b, a], axis=1)])
    triangles = np.concatenate([top, top[:, ::-1] + count, walls])
    semantic = np.repeat([SEMANTICS.index(s) for s in ("roof", "ground", "wall")], [len(top), len(top), len(walls)])
    heights = np.concatenate([eaves + rise(points), np.full(count, base)])
    return Shell(
        vertices=np.column_stack([np.concatenate([points, points]), heights]),
        triangles=triangles.astype(np.int32),
        semantic=semantic.astype(np.uint8),
        texture=np.full(len(triangles), -1, np.int32),
        uv=np.zeros((len(triangles), 3, 2), np.float32),
    )


def _regions(footprint: Polygon, planes: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """The footprint cut into the regions where one plane is the lowest, with shared corners."""
    reach = 2 * footprint.length
    ridges = [_ridge(planes, i, j, reach) for i in range(len(planes)) for j in range(i)]
    lines = [footprint.boundary, *(LineString(ridge + centre) for ridge in ridges if ridge is not None)]
    noded = shapely.union_all(lines, grid_size=GRID_M)
    faces = shapely.get_parts(shapely.polygonize(shapely.get_parts(noded)))
    return faces[shapely.contains(footprint, shapely.point_on_surface(faces))]


def _ridge(planes: np.ndarray, i: int, j: int, reach: float) -> np.ndarray | None:
    """The segment (2, 2) on which planes i and j meet and none is lower, up to `reach` from the centre; None without."""
    difference = planes[i] - planes[j]
    size = np.hypot(*difference[:2])
    if size < 1e-9:
        return None
    normal = difference[:2] / size
    foot, ahead = -normal * difference[2] / size, np.array([-normal[1], normal[0]])
    # every other plane is above at foot + t ahead where start + t slope >= 0
    others = np.delete(planes, [i, j], axis=0) - planes[i]
    start, slope = others[:, :2] @ foot + others[:, 2], others[:, :2] @ ahead
    if (start[np.abs(slope) < 1e-9] < -1e-9).any():
        return None
    grows, falls = slope >= 1e-9, slope <= -1e-9
    low = np.max(-start[grows] / slope[grows], initial=-reach)
    high = np.min(-start[falls] / slope[falls], initial=reach)
    return np.array([foot + low * ahead, foot + high * ahead]) if high - low > GRID_M else None
