"""The metric frame of a block: checking the one that is named, or choosing one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from facade_core.errors import InputError

if TYPE_CHECKING:
    from pyproj import CRS
    from shapely import Polygon

LONLAT = "EPSG:4326"
_MARGIN = 2.0  # degrees by which blocks at a border may leave the area of their frame
_TOLERANCE = 0.01  # a frame whose metre is off by more than this spoils every height and floor count


def named_frame(text: str) -> CRS:
    """The horizontal part of a named CRS; InputError unless it is projected and in metres."""
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        crs = CRS.from_user_input(text)
    except CRSError as error:
        raise InputError(f"{text!r} is not a known CRS; give a projected one in metres, e.g. EPSG:32635") from error
    if crs.is_compound:
        crs = crs.sub_crs_list[0]
    if not crs.is_projected or any(axis.unit_conversion_factor != 1.0 for axis in crs.axis_info):
        raise InputError(
            f"{text!r} ({crs.name}) is not projected in metres; give e.g. EPSG:32635, or leave crs out for UTM"
        )
    return crs


def known_frame(text: str) -> CRS:
    """Any CRS by its name; InputError where pyproj does not know it."""
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        return CRS.from_user_input(text)
    except CRSError as error:
        raise InputError(f"{text!r} is not a known CRS; give one such as EPSG:4326 or EPSG:28992") from error


def block_frame(source: str, longitude: float, latitude: float) -> CRS:
    """The frame of a block that names none: the source's own where it measures metres there, else the UTM zone."""
    try:
        frame = named_frame(source)
        check_scale(frame, longitude, latitude)
    except InputError:
        return utm_frame(longitude, latitude)
    return frame


def utm_frame(longitude: float, latitude: float) -> CRS:
    """The UTM zone (WGS 84) that holds a point; InputError near the poles, where UTM is not defined."""
    from pyproj import CRS

    if not -80.0 <= latitude <= 84.0:
        raise InputError(f"no UTM zone at latitude {latitude:.2f}; give a projected crs in metres")
    zone = min(int((longitude + 180.0) // 6.0) + 1, 60)
    return CRS.from_epsg((32600 if latitude >= 0 else 32700) + zone)


def check_scale(crs: CRS, longitude: float, latitude: float) -> None:
    """InputError where a metre of the frame is not a metre on the ground (Web Mercator, a zone far away)."""
    from pyproj import Proj
    from pyproj.exceptions import ProjError

    try:
        factors = Proj(crs).get_factors(longitude, latitude)
        scales = (factors.meridional_scale, factors.parallel_scale)
    except ProjError:
        scales = (math.inf, math.inf)
    if not all(abs(scale - 1.0) <= _TOLERANCE for scale in scales):
        far = max(scales, key=lambda scale: abs(scale - 1.0))
        remedy = f"give e.g. EPSG:{utm_frame(longitude, latitude).to_epsg()}, or leave crs out"
        raise InputError(
            f"{crs.to_string()} ({crs.name}) does not measure metres at {longitude:.4f}, {latitude:.4f} "
            f"(scale {far:.3g}); {remedy}"
        )


def outside(crs: CRS, longitude: float, latitude: float) -> tuple[str, ...]:
    """A note where a point lies far outside the area that a frame is made for; none where it does not."""
    area = crs.area_of_use
    if area is None:
        return ()
    west, south, east, north = area.bounds
    within = south - _MARGIN <= latitude <= north + _MARGIN
    within &= (longitude - west + _MARGIN) % 360 <= (east - west) % 360 + 2 * _MARGIN
    if within:
        return ()
    return (
        f"the buildings lie at {longitude:.3f}, {latitude:.3f}, far from where {crs.to_string()} ({crs.name}) is used "
        f"({area.name}): check crs, buildings.crs and buildings.offset",
    )


def area_outline(area: Sequence[float], crs: CRS) -> Polygon:
    """A [west, south, east, north] box in degrees as a polygon in the frame, its sides split so that they stay true."""
    import shapely
    from pyproj import Transformer

    west, south, east, north = area
    box = shapely.segmentize(shapely.box(west, south, east, north), max(east - west, north - south) / 64)
    to_frame = Transformer.from_crs(LONLAT, crs, always_xy=True)
    return shapely.transform(box, to_frame.transform, interleaved=False)


def to_lonlat(crs: str, bounds: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    """(xmin, ymin, xmax, ymax) in a frame -> (west, south, east, north) in degrees."""
    from pyproj import Transformer

    return Transformer.from_crs(crs, LONLAT, always_xy=True).transform_bounds(*bounds)
