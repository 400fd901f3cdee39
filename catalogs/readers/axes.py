"""Axis order and units of the coordinate systems that files name."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pyproj import CRS, Transformer
from pyproj.exceptions import CRSError

from catalogs.crs import EARTH_RADIUS_M, LONLAT, metres_per_height_unit
from catalogs.readers.settings import MODELS
from facade_core.core.arrays import Float64Array
from facade_core.core.errors import InputError

_BARE_CODE = re.compile(r"\s*(?:epsg:)?(\d{4,6})\s*", re.IGNORECASE)
_EPSG_CODES = re.compile(r"epsg(?:\.xml#|[:/]+(?:[\w.]*[:/])?)(\d{4,6})(?:\+(\d{4,6}))?(?!\d)", re.IGNORECASE)
_SURVEY_CODES = {f"ETRS89_UTM{zone}": 25800 + zone for zone in (31, 32, 33)} | {  # names of the German surveys (AdV)
    f"DE_DHDN_3GK{zone}": 31464 + zone for zone in range(2, 6)
}
_SURVEY_CODES |= {"DE_DHHN92_NH": 5783, "DE_DHHN2016_NH": 7837}


@dataclass(frozen=True, slots=True)
class CoordinateAxes:
    """Axis order and units of the coordinates of a file.

    Attributes
    ----------
    crs : "EPSG:n", None where it is unknown.
    horizontal_crs : part without heights, by which systems are compared.
    north_first : True where the first number is the northing or latitude.
    metres_per_unit : metres per unit of east and of north.
    metres_per_height_unit : metres per unit of height.
    """

    crs: str | None = None
    horizontal_crs: str | None = None
    north_first: bool = False
    metres_per_unit: tuple[float, float] = (1.0, 1.0)
    metres_per_height_unit: float = 1.0

    def to_east_north_up(self, points: Float64Array) -> Float64Array:
        """Return points of the file as x east, y north, z in metres.

        Parameters
        ----------
        points : (n, 3) coordinates as stored.
        """
        order = [1, 0, 2] if self.north_first else [0, 1, 2]
        return points[:, order] * (1.0, 1.0, self.metres_per_height_unit)


def resolve_crs_axes(
    name: str | None, sample_point: tuple[float, float] | None, path: Path
) -> tuple[CoordinateAxes, str | None]:
    """Return the axes of a coordinate system, and a remark where they are a guess.

    The axis order is that of the system, unless only the other order puts the sample point in its area of use. Heights have
    the unit of the vertical part. Without one they have the unit of a projected system, since surveys in feet measure heights
    in feet, and metres next to degrees.

    Parameters
    ----------
    name : "EPSG:7415", a bare code, an OGC URN or URL, also compound, CRS84, or a name of the German surveys.
    sample_point : first two coordinates of a point of the file.
    path : file, for messages.

    Raises
    ------
    InputError
        For a geocentric system.
    """
    if not name:
        return CoordinateAxes(), None
    codes = _parse_epsg_codes(name)
    parts = _crs_parts(codes)
    horizontal = next((part for part in parts if not part.is_vertical), None)
    if horizontal is None:
        return CoordinateAxes(), "names of a CRS that are not understood"
    is_compound = len(parts) == 2 and parts[1].is_vertical and len(horizontal.axis_info) == 2
    is_whole = len(codes) == 1 or is_compound
    crs = f"EPSG:{'+'.join(map(str, codes))}" if is_whole else horizontal.to_string()
    if horizontal.is_geocentric:
        raise InputError(f"{path} is in geocentric {crs}; reproject it to a projected CRS in metres")
    north_first = horizontal.axis_info[0].direction == "north" and "CRS84" not in name
    is_bare_code = _BARE_CODE.fullmatch(name) is not None
    north_first, remark = _axis_order(horizontal, north_first, sample_point, is_bare_code=is_bare_code)
    vertical = next((part for part in parts if part.is_vertical), horizontal)
    scale = _metres_per_unit(horizontal, sample_point, north_first)
    return CoordinateAxes(crs, horizontal.to_string(), north_first, scale, metres_per_height_unit(vertical)), remark


def _metres_per_unit(crs: CRS, sample_point: tuple[float, float] | None, north_first: bool) -> tuple[float, float]:
    unit = crs.axis_info[0].unit_conversion_factor
    if not crs.is_geographic:
        return unit, unit
    latitude = 0.0 if sample_point is None else sample_point[0 if north_first else 1] * unit
    metres = EARTH_RADIUS_M * unit
    return metres * max(math.cos(latitude), 1e-3), metres


def _parse_epsg_codes(name: str) -> list[int]:
    """Return the EPSG codes of a name; those of a compound system in its order."""
    if short := _BARE_CODE.fullmatch(name):
        return [int(short[1])]
    codes = [int(code) for found in _EPSG_CODES.findall(name) for code in found if code]
    surveys = [code for survey, code in _SURVEY_CODES.items() if survey in name]
    return codes or surveys or [4326] * ("CRS84" in name)


def _crs_parts(codes: Sequence[int]) -> list[CRS]:
    """Return the horizontal and vertical systems of the codes; an empty list where a code is unknown."""
    try:
        frames = [CRS.from_epsg(code) for code in codes]
    except CRSError:
        return []
    return [part for frame in frames for part in frame.sub_crs_list or [frame]]


def _axis_order(
    crs: CRS, north_first: bool, sample_point: tuple[float, float] | None, *, is_bare_code: bool
) -> tuple[bool, str | None]:
    """Return whether the northing is first, and a remark where that is a guess.

    is_bare_code: True for a bare code, which many writers pair with their own axis order.
    """
    if sample_point is None:
        return north_first, None
    east, north = sample_point[::-1] if north_first else sample_point
    other = _is_near_area_of_use(crs, north, east)
    if not _is_near_area_of_use(crs, east, north):
        remark = "frames whose axes are swapped" if other else "frames far from the area they are made for"
        return north_first != other, remark
    if other and north_first and is_bare_code:
        return True, "frames whose first axis is taken to be north, as EPSG defines them"
    return north_first, None


def _is_near_area_of_use(crs: CRS, east: float, north: float) -> bool:
    """Return True where a place is in the area of use of a system, or near it."""
    area = crs.area_of_use
    longitude, latitude = Transformer.from_crs(crs, LONLAT, always_xy=True).transform(east, north)
    if not (abs(longitude) <= 360.0 and abs(latitude) <= 90.0):
        return False
    if area is None:
        return True
    beyond = min(MODELS.area_margin_share * (area.north - area.south), MODELS.max_area_margin_deg)
    if not area.south - beyond <= latitude <= area.north + beyond:
        return False
    width = (area.east - area.west) % 360.0 or 360.0
    beyond = min(MODELS.area_margin_share * width, MODELS.max_area_margin_deg)
    return bool((longitude - area.west + beyond) % 360.0 <= width + 2 * beyond)
