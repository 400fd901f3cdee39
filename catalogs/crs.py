"""Coordinate reference systems: parsing, checks, and the choice of a metric frame for a block."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.core.errors import InputError

if TYPE_CHECKING:
    from pyproj import CRS
    from shapely import Polygon

LONLAT = "EPSG:4326"
EARTH_RADIUS_M = 6_371_000.0  # m; mean radius
_AREA_MARGIN_DEG = 2.0  # tolerance around the area of use, for blocks at a border
_EARTH_RADIUS_RANGE_M = (6.3e6, 6.45e6)  # m; semi-major axes of ellipsoids and spheres of the Earth
_MAX_NAME_LENGTH = 60
_GRID_FILE = re.compile(r"(?:grids|file|init)\s*=[^\s\"]*[/\\~]|PARAMETERFILE\[[^\]]*[/\\~]", re.IGNORECASE)
# Krovak systems with axes south and west, and their equivalents with axes east and north.
_EAST_NORTH_EQUIVALENTS = {"EPSG:5513": "EPSG:5514", "EPSG:2065": "EPSG:5221"}
_MAX_SCALE_ERROR = 0.01  # larger errors falsify heights and floor counts


def parse_metric_crs(text: str) -> CRS:
    """Return the horizontal part of a CRS that is projected in metres.

    Raises
    ------
    InputError
        Where the CRS is unknown, not projected, or not in metres.
    """
    crs = parse_crs(text)
    if not crs.is_projected or any(axis.unit_conversion_factor != 1.0 for axis in crs.axis_info):
        raise InputError(
            f"{text!r} ({crs.name}) is not projected in metres; give e.g. EPSG:32635, or leave crs out for UTM"
        )
    return crs


@lru_cache(maxsize=64)
def parse_crs(text: str) -> CRS:
    """Return the horizontal part of a CRS by its name.

    Raises
    ------
    InputError
        Where the CRS is unknown, not of the Earth, or needs a grid file.
    """
    from pyproj import CRS
    from pyproj.exceptions import CRSError, ProjError

    shown = repr(text if len(text) <= _MAX_NAME_LENGTH else f"{text[:_MAX_NAME_LENGTH]}...")
    remedy = "give one such as EPSG:32635"
    if _GRID_FILE.search(text):
        raise InputError(f"{shown} names a grid file of this machine; {remedy}")
    try:
        crs = CRS.from_user_input(text)
        if crs.is_compound:
            crs = crs.sub_crs_list[0]
        if not (crs.is_projected or crs.is_geographic):
            raise InputError(f"{shown} ({crs.name}) is a {crs.type_name}, which has no places on a map; {remedy}")
        ellipsoid = crs.ellipsoid
        if ellipsoid is None or not _EARTH_RADIUS_RANGE_M[0] < ellipsoid.semi_major_metre < _EARTH_RADIUS_RANGE_M[1]:
            raise InputError(f"{shown} ({crs.name}) is not a frame of the Earth; {remedy}")
        coordinate_transform(crs, LONLAT)
    except (CRSError, ProjError, UnicodeError) as error:
        raise InputError(f"{shown} is not a known CRS; {remedy}") from error
    return crs


def coordinate_transform(
    source: CRS | str, target: CRS | str
) -> Callable[[Float64Array, Float64Array], tuple[Float64Array, Float64Array]]:
    """Return a function that transforms x (east) and y (north) from one CRS to another.

    Coordinates without an image in the target become infinite. Axes of north and east are taken in the order east, north;
    axes of other directions, such as south and west, keep the order of the CRS.

    Raises
    ------
    InputError
        Where no transformation is known.
    """
    from pyproj import Transformer
    from pyproj.exceptions import ProjError

    try:
        transform = Transformer.from_crs(source, target, always_xy=True).transform
    except ProjError as error:
        raise InputError(
            f"no transformation is known from {_crs_name(source)} to {_crs_name(target)}; give another crs"
        ) from error
    return transform


def is_same_frame(one: str, other: str) -> bool:
    """Return whether two CRS give a place the same coordinates, to a metre where lengths are metres.

    Compared in the middle of the area of use that either states; names of the same system differ between programs.
    """
    frames = [parse_crs(one), parse_crs(other)]
    areas = [frame.area_of_use for frame in frames if frame.area_of_use is not None]
    if frames[0].equals(frames[1], ignore_axis_order=True) or not areas:
        return True
    area = areas[0]
    place = (np.array([(area.west + area.east) / 2]), np.array([(area.south + area.north) / 2]))
    (x, y), (u, v) = (coordinate_transform(LONLAT, frame)(*place) for frame in frames)
    tolerance = 1.0 if all(frame.is_projected for frame in frames) else 1e-5
    return bool(np.hypot(x - u, y - v)[0] <= tolerance)


def metres_per_height_unit(crs: CRS | str | None) -> float:
    """Return the metres per unit of heights in a CRS, 1 without one.

    That is the unit of its vertical part. Without one it is the unit of a projected system of feet, since surveys in feet
    measure heights in feet; next to degrees and to larger units heights are in metres.

    Raises
    ------
    InputError
        Where the name of the CRS is unknown.
    """
    if crs is None:
        return 1.0
    if isinstance(crs, str):
        parse_crs(crs)
        crs = _crs_with_heights(crs)
    parts = crs.sub_crs_list or [crs]
    vertical = [a.unit_conversion_factor for part in parts for a in part.axis_info if a.direction in ("up", "down")]
    if vertical:
        return float(vertical[0])
    return min(1.0, float(parts[0].axis_info[0].unit_conversion_factor)) if parts[0].is_projected else 1.0


def have_heights_above_sea(names: Iterable[str]) -> bool:
    """Return whether every system has a vertical part; False without any."""
    frames = [_crs_with_heights(name) for name in names]
    return bool(frames) and all(any(part.is_vertical for part in frame.sub_crs_list) for frame in frames)


@lru_cache(maxsize=64)
def _crs_with_heights(text: str) -> CRS:
    from pyproj import CRS

    return CRS.from_user_input(text)


def has_east_north_axes(crs: CRS) -> bool:
    """Return True for axes east and north in any order, or axes of a polar map."""
    directions = [axis.direction for axis in crs.axis_info]
    return set(directions[:2]) == {"east", "north"} or (len(directions) > 1 and directions[0] == directions[1])


def check_block_crs(crs: CRS, longitude: float, latitude: float) -> None:
    """Raise InputError where a CRS does not suit a block at a place.

    A unit must be a metre on the ground, which it is not in Web Mercator and in a distant zone. x must run east and y
    north, since other axes mirror or turn a block.

    Parameters
    ----------
    crs : projected CRS.
    longitude, latitude : place of the block, degrees.
    """
    _check_scale(crs, longitude, latitude)
    _check_axes(crs, longitude, latitude)


def _check_scale(crs: CRS, longitude: float, latitude: float) -> None:
    """Raise InputError where a unit of the CRS is not a metre on the ground."""
    from pyproj import Proj
    from pyproj.exceptions import ProjError

    try:
        factors = Proj(crs).get_factors(longitude, latitude)
        scales = (factors.meridional_scale, factors.parallel_scale)
    except ProjError:
        scales = (math.inf, math.inf)
    if not all(abs(scale - 1.0) <= _MAX_SCALE_ERROR for scale in scales):
        if _is_swapped_place(crs, longitude, latitude):
            raise InputError(
                f"longitude and latitude look swapped: the buildings lie at {longitude:.4f}, {latitude:.4f}, far from where "
                f"{crs.to_string()} ({crs.name}) is used; write longitude first"
            )
        far = max(scales, key=lambda scale: abs(scale - 1.0))
        remedy = f"give e.g. EPSG:{utm_crs(longitude, latitude).to_epsg()}, or leave crs out"
        place = f"{longitude:.4f}, {latitude:.4f}"
        fault = f"does not measure metres at {place} (scale {far:.3g})"
        if note_outside_area_of_use(crs, longitude, latitude):
            fault = f"does not cover {place}"
        raise InputError(f"{crs.to_string()} ({crs.name}) {fault}; {remedy}")


def _is_swapped_place(crs: CRS, longitude: float, latitude: float) -> bool:
    """Return True where a place outside the area of use of a CRS is inside once its axes are swapped."""
    if crs.area_of_use is None or abs(longitude) > 90.0 or not note_outside_area_of_use(crs, longitude, latitude):
        return False
    return not note_outside_area_of_use(crs, latitude, longitude)


def _check_axes(crs: CRS, longitude: float, latitude: float) -> None:
    """Raise InputError where x does not run east or y does not run north."""
    step = 1e-4  # degrees
    x, y = coordinate_transform(LONLAT, crs)(
        np.array([longitude, longitude + step, longitude]), np.array([latitude, latitude, latitude + step])
    )
    east, north = np.array([x[1] - x[0], y[1] - y[0]]), np.array([x[2] - x[0], y[2] - y[0]])
    turned = set(axis.direction for axis in crs.axis_info[:2]) == {"east", "north"} and east[0] < 0
    if has_east_north_axes(crs) and east[0] * north[1] - east[1] * north[0] > 0 and not turned:
        return
    axes = " and ".join(axis.direction for axis in crs.axis_info)
    instead = _EAST_NORTH_EQUIVALENTS.get(crs.to_string()) or f"EPSG:{utm_crs(longitude, latitude).to_epsg()}"
    raise InputError(
        f"{crs.to_string()} ({crs.name}) has the axes {axes}, which mirrors or turns a block; give one with east and north, "
        f"e.g. {instead}, or leave crs out"
    )


def choose_block_crs(source: str, longitude: float, latitude: float) -> CRS:
    """Return the CRS of the source where it measures metres at the place, else the UTM zone.

    Parameters
    ----------
    source : CRS of the source of the buildings.
    longitude, latitude : place of the block, degrees.
    """
    try:
        frame = parse_metric_crs(source)
        check_block_crs(frame, longitude, latitude)
    except InputError:
        return utm_crs(longitude, latitude)
    return frame


def utm_crs(longitude: float, latitude: float) -> CRS:
    """Return the UTM zone (WGS 84) of a point.

    Raises
    ------
    InputError
        Near the poles, where UTM is not defined.
    """
    from pyproj import CRS

    if not -80.0 <= latitude <= 84.0:
        raise InputError(f"no UTM zone at latitude {latitude:.2f}; give a projected crs in metres")
    zone = int((longitude + 180.0) % 360.0 // 6.0) + 1
    return CRS.from_epsg((32600 if latitude >= 0 else 32700) + zone)


def note_outside_area_of_use(crs: CRS, longitude: float, latitude: float) -> tuple[str, ...]:
    """Return a note where a point is far outside the area of use, else an empty tuple.

    Parameters
    ----------
    crs : CRS of the block.
    longitude, latitude : place of the block, degrees.
    """
    area = crs.area_of_use
    if area is None:
        return ()
    west, south, east, north = area.bounds
    within = south - _AREA_MARGIN_DEG <= latitude <= north + _AREA_MARGIN_DEG
    across = east - west if east > west else east - west + 360  # the area may lie across the antimeridian
    within &= (longitude - west + _AREA_MARGIN_DEG) % 360 <= across + 2 * _AREA_MARGIN_DEG
    if within:
        return ()
    return (
        f"the buildings lie at {longitude:.3f}, {latitude:.3f}, far from where {crs.to_string()} ({crs.name}) is used "
        f"({area.name}): check crs, buildings.crs and buildings.offset",
    )


def project_lonlat_box(area: Sequence[float], crs: CRS) -> Polygon:
    """Return a [west, south, east, north] box in degrees as a densified polygon in a CRS."""
    import shapely

    west, south, east, north = area
    box = shapely.segmentize(shapely.box(west, south, east, north), max(east - west, north - south) / 64)
    return shapely.transform(box, coordinate_transform(LONLAT, crs), interleaved=False)


def bounds_to_lonlat(crs: str, bounds: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    """Return (xmin, ymin, xmax, ymax) of a CRS as (west, south, east, north) in degrees."""
    from pyproj import Transformer

    return Transformer.from_crs(crs, LONLAT, always_xy=True).transform_bounds(*bounds)


def middle_to_lonlat(crs: str, bounds: tuple[float, float, float, float]) -> tuple[float, float]:
    """Return longitude and latitude of the middle of (xmin, ymin, xmax, ymax); a box may cross the antimeridian."""
    middle = ((bounds[0] + bounds[2]) / 2, (bounds[1] + bounds[3]) / 2)
    longitude, latitude, *_ = bounds_to_lonlat(crs, middle * 2)
    return (longitude + 180.0) % 360.0 - 180.0, latitude


def _crs_name(crs: CRS | str) -> str:
    return (crs if isinstance(crs, str) else crs.to_string())[:_MAX_NAME_LENGTH]
