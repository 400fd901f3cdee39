"""Location of the buildings of a block on the Earth.

Buildings at impossible coordinates, or far from the others, become faults before anything is computed over the extent.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar, overload

import numpy as np

from catalogs.buildings.axis_mistakes import axis_mistake
from catalogs.buildings.settings import SITES
from catalogs.crs import EARTH_RADIUS_M, LONLAT, coordinate_transform, has_east_north_axes, parse_crs
from catalogs.features import BuildingModels, CentrelinesAndGround, Fault, Footprints
from facade_core.core.arrays import BoolArray, Float64Array, Int32Array, Int64Array
from facade_core.core.errors import InputError

if TYPE_CHECKING:
    from pyproj import CRS


BuildingSource = Footprints | BuildingModels
SourceT = TypeVar("SourceT", Footprints, BuildingModels)
Bounds = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class BoxLocations:
    """Locations of n bounding boxes on a spherical Earth.

    Attributes
    ----------
    corners : (n, 4, 2) longitude and latitude, degrees; NaN where a box has no location.
    centre : (n, 3) metres from the centre of the Earth.
    size : (n,) diagonal, metres.
    """

    corners: Float64Array
    centre: Float64Array
    size: Float64Array

    @property
    def location_mask(self) -> BoolArray:
        """Return a mask (n,) of the boxes with a location."""
        return np.isfinite(self.size)

    def mean_lonlat(self, mask: BoolArray) -> tuple[float, float]:
        """Return the mean (longitude, latitude) of the selected boxes, degrees.

        Parameters
        ----------
        mask : (n,) flags, or indices.
        """
        return _point_lonlat(self.centre[mask].mean(axis=0))

    def lonlat_bounds(self, mask: BoolArray) -> Bounds:
        """Return (west, south, east, north) of the selected boxes, degrees.

        East exceeds 180 across the date line.
        """
        corners = self.corners[mask].reshape(-1, 2)
        middle = self.mean_lonlat(mask)[0]
        longitude = middle + (corners[:, 0] - middle + 180.0) % 360.0 - 180.0
        latitude = corners[:, 1]
        return float(longitude.min()), float(latitude.min()), float(longitude.max()), float(latitude.max())


def check_area_span(area: Sequence[float]) -> None:
    """Raise InputError where an area is too large to search for a block.

    Parameters
    ----------
    area : [west, south, east, north], degrees.
    """
    west, south, east, north = area
    wide = EARTH_RADIUS_M * math.radians(east - west) * math.cos(math.radians((south + north) / 2))
    span = max(wide, EARTH_RADIUS_M * math.radians(north - south))
    if span > SITES.max_area_span_m:
        raise InputError(
            f"{list(area)} spans {span / 1000:,.0f} km; give the block's own, up to {SITES.max_area_span_m / 1000:g} km"
        )


def locate_boxes(crs: str, boxes: Float64Array) -> BoxLocations:
    """Return the locations of bounding boxes.

    Parameters
    ----------
    crs : CRS of the boxes.
    boxes : (n, 4) of (xmin, ymin, xmax, ymax).

    Raises
    ------
    InputError
        Where the CRS cannot be used, or the coordinates contradict the order of its axes.
    """
    frame = parse_crs(crs)
    corners = boxes[:, [0, 1, 2, 1, 2, 3, 0, 3]].reshape(-1, 2)
    longitude, latitude = coordinate_transform(frame, LONLAT)(corners[:, 0], corners[:, 1])
    lonlat = np.column_stack([longitude, latitude])
    nowhere = ~(np.isfinite(lonlat).all(axis=1) & (np.abs(lonlat) <= (360.0, 90.0)).all(axis=1))
    lonlat[nowhere] = np.nan
    lam, phi = np.radians(lonlat).T
    points = EARTH_RADIUS_M * np.column_stack([np.cos(phi) * np.cos(lam), np.cos(phi) * np.sin(lam), np.sin(phi)])
    points = points.reshape(-1, 4, 3)
    size = np.linalg.norm(points[:, :2] - points[:, 2:], axis=2).max(axis=1)
    if frame.is_geographic:  # a chord is short for boxes around the globe
        size = np.maximum(
            size, EARTH_RADIUS_M * np.cos(phi.reshape(-1, 4).mean(axis=1)) * np.radians(boxes[:, 2] - boxes[:, 0])
        )
    places = BoxLocations(lonlat.reshape(-1, 4, 2), points.mean(axis=1), size)
    if mistake := axis_mistake(frame, boxes):
        raise InputError(f"in {crs[:60]} {mistake}")
    if places.location_mask.any() and not has_east_north_axes(frame):
        _check_axis_order(frame, *places.mean_lonlat(places.location_mask))
    return places


def _check_axis_order(frame: CRS, longitude: float, latitude: float) -> None:
    """Raise InputError where coordinates of a CRS with axes south and west are outside its area of use.

    Many writers store such coordinates as east and north.
    """
    area = frame.area_of_use
    if area is not None and not (
        area.south - SITES.area_margin_deg <= latitude <= area.north + SITES.area_margin_deg
        and area.west - SITES.area_margin_deg <= longitude <= area.east + SITES.area_margin_deg
    ):
        axes = " and ".join(axis.direction for axis in frame.axis_info)
        raise InputError(
            f"coordinates in {frame.to_string()} ({frame.name}) count {axes}, which puts these at {longitude:.3f}, "
            f"{latitude:.3f}, outside {area.name}; if they count east and north, name the frame that does"
        )


def reject_stray_buildings(
    sources: Sequence[BuildingSource], area: Sequence[float] | None, centrelines: CentrelinesAndGround | None
) -> tuple[list[BuildingSource], Bounds | None]:
    """Turn buildings that cannot belong to one block into faults.

    A building is rejected where it has no location, exceeds SITES.max_building_size_m, or belongs to a small group farther than
    SITES.neighbour_distance_m from the main one.

    Parameters
    ----------
    sources : footprints and models.
    area : [west, south, east, north] in degrees; buildings outside stay unchanged. None for no limit.
    centrelines : streets, which decide between groups of buildings that are far apart.

    Returns
    -------
    sources : the sources without the rejected buildings.
    bounds : (west, south, east, north) in degrees of the accepted buildings, or of all where none is accepted; None without
        a location.

    Raises
    ------
    InputError
        Where the accepted buildings span more than SITES.max_block_span_m.
    """
    found = [locate_boxes(source.crs, source.bounding_boxes()) for source in sources if source.crs]
    every = BoxLocations(*(np.concatenate([getattr(p, name) for p in found]) for name in ("corners", "centre", "size")))
    owner = np.repeat(np.arange(len(found)), [len(places.size) for places in found])
    meant = every.location_mask & _intersects_area(every.corners, area)
    sound = meant & (every.size <= SITES.max_building_size_m)
    spanned = every.lonlat_bounds(every.location_mask) if every.location_mask.any() else None
    group = np.full(len(owner), -1)
    group[sound] = _neighbour_groups(every.centre[sound])
    kept = sound & np.isin(group, _main_groups(every, group, centrelines))

    reasons: dict[int, str] = {}
    for index in np.flatnonzero(~every.location_mask).tolist():
        crs = sources[owner[index]].crs
        reasons[index] = f"it lies nowhere on Earth in {(crs or '')[:60]}; mend its coordinates, or check buildings.crs"
    for index in np.flatnonzero(meant & ~sound).tolist():
        west, south, east, north = every.lonlat_bounds(np.array([index]))
        reasons[index] = (
            f"it reaches from {west:.4f}, {south:.4f} to {east:.4f}, {north:.4f}, {every.size[index] / 1000:,.0f} km; a "
            f"building is up to {SITES.max_building_size_m / 1000:g} km long: mend its corners, or remove it"
        )
    for index in np.flatnonzero(sound & ~kept).tolist():
        longitude, latitude = every.mean_lonlat(np.array([index]))
        far = np.linalg.norm(every.centre[kept] - every.centre[index], axis=1).min() / 1000
        reasons[index] = (
            f"it lies at {longitude:.4f}, {latitude:.4f}, {far:,.0f} km from the other {kept.sum()}; mend its coordinates, or "
            "remove it"
        )
    starts = np.searchsorted(owner, np.arange(len(sources)))
    left = [
        _without_items(source, {index - start: why for index, why in reasons.items() if owner[index] == number})
        for number, (source, start) in enumerate(zip(sources, starts, strict=True))
    ]
    return left, every.lonlat_bounds(kept) if kept.any() else spanned


@overload
def _without_items(source: Footprints, reasons: dict[int, str]) -> Footprints: ...
@overload
def _without_items(source: BuildingModels, reasons: dict[int, str]) -> BuildingModels: ...
def _without_items(source: SourceT, reasons: dict[int, str]) -> SourceT:
    if not reasons:
        return source
    faults: list[Fault] = [
        Fault(source.items[index].id, "building", reasons[index], source.item_outline(index))
        for index in sorted(reasons)
    ]
    items = tuple(item for index, item in enumerate(source.items) if index not in reasons)
    return replace(source, items=items, faults=(*source.faults, *faults))


def _intersects_area(corners: Float64Array, area: Sequence[float] | None) -> BoolArray:
    """Return a mask (n,) of the boxes that intersect the area."""
    if area is None:
        return np.ones(len(corners), bool)
    west, south, east, north = area
    longitude = (corners[..., 0] - west + 180.0) % 360.0 - 180.0 + west
    inside: BoolArray = (longitude.max(axis=1) >= west) & (longitude.min(axis=1) <= east)
    inside &= (corners[..., 1].max(axis=1) >= south) & (corners[..., 1].min(axis=1) <= north)
    return inside


def _neighbour_groups(points: Float64Array) -> Int32Array:
    """Return the group number (n,) of each point; neighbours share a group."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    if len(points) == 0:
        return np.empty(0, np.int64)
    cells, cell = np.unique(
        np.floor(points / (SITES.neighbour_distance_m / SITES.cells_per_neighbour_distance)),
        axis=0,
        return_inverse=True,
    )
    pairs = cKDTree(cells).query_pairs(SITES.cells_per_neighbour_distance, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(len(cells), len(cells)))
    groups: Int32Array = connected_components(graph, directed=False)[1][cell]
    return groups


def _main_groups(places: BoxLocations, group: Int64Array, centrelines: CentrelinesAndGround | None) -> Int64Array:
    """Return the groups with many buildings; of distant ones those near streets."""
    counts = np.bincount(group[group >= 0])
    main = np.flatnonzero(counts > SITES.max_stray_share * counts.max(initial=0))
    if _diagonal(places.centre[np.isin(group, main)]) <= SITES.max_block_span_m:
        return main
    if len(main) > 1:
        near = _groups_near_streets(places, group, main, centrelines)
        if len(near) and _diagonal(places.centre[np.isin(group, near)]) <= SITES.max_block_span_m:
            return near
    span = _diagonal(places.centre[np.isin(group, main)]) / 1000
    where = [f"{counts[g]} at {x:.4f}, {y:.4f}" for g in main[:3] for x, y in [places.mean_lonlat(group == g)]]
    raise InputError(
        f"the buildings span {span:,.0f} km ({'; '.join(where)}), and a block up to {SITES.max_block_span_m / 1000:g} km; "
        "give area, or mend the coordinates of those elsewhere"
    )


def _groups_near_streets(
    places: BoxLocations, group: Int64Array, main: Int64Array, centrelines: CentrelinesAndGround | None
) -> Int64Array:
    if centrelines is None or not centrelines.crs or not centrelines.items:
        return main[:0]
    streets = locate_boxes(centrelines.crs, centrelines.bounding_boxes())
    centres = streets.centre[streets.location_mask]
    return main[[_is_near_any(places.centre[group == one], centres) for one in main]]


def _is_near_any(points: Float64Array, others: Float64Array) -> bool:
    from scipy.spatial import cKDTree

    return len(others) > 0 and bool(
        np.isfinite(cKDTree(others).query(points, distance_upper_bound=2 * SITES.neighbour_distance_m)[0]).any()
    )


def _diagonal(points: Float64Array) -> float:
    return float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0


def _point_lonlat(point: Float64Array) -> tuple[float, float]:
    x, y, z = point
    return float(np.degrees(np.arctan2(y, x))), float(np.degrees(np.arctan2(z, np.hypot(x, y))))
