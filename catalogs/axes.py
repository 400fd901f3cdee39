"""Frames as files name them: which axis is east, and what a unit of each is in metres."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catalogs.frames import LONLAT
from facade_core.errors import InputError

if TYPE_CHECKING:
    from pyproj import CRS

EARTH_RADIUS = 6_371_000.0  # m
_MARGIN = 1.0  # degrees; a file may reach a little beyond the area that its frame is made for
_CODE = re.compile(r"epsg(?:/[^/&]*/|:[^:,]*:|:)(\d{4,6})(?!\d)", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Axes:
    """How the coordinates of a file are to be read.

    crs: "EPSG:n" or "OGC:CRS84", None where none is known; north_first: its first number is the northing or latitude;
    scale: metres in a unit of east, and of north; vertical: metres in a unit of height.
    """

    crs: str | None = None
    north_first: bool = False
    scale: tuple[float, float] = (1.0, 1.0)
    vertical: float = 1.0

    def applied(self, points: np.ndarray) -> np.ndarray:
        """Points (n, 3) of the file as x east, y north, z metres."""
        order = [1, 0, 2] if self.north_first else [0, 1, 2]
        return points[:, order] * (1.0, 1.0, self.vertical)


def axes_of(name: str | None, place: tuple[float, float] | None, path: Path) -> tuple[Axes, str | None]:
    """The axes of a frame by the name that a file gives, and a remark (see features.Remark) where they are a guess.

    name: "EPSG:7415", an URN or URL of OGC, also compound; place: the first two coordinates of a point of the file.
    The order of the axes is the frame's own, unless only the other order puts the place where the frame is made for.
    Raises InputError for a geocentric frame.
    """
    if not name:
        return Axes(), None
    frames, crs = _named(name)
    horizontal = frames[0] if frames else None
    if horizontal is None:
        return Axes(), "names of a CRS that are not understood"
    if horizontal.is_geocentric:
        raise InputError(f"{path} is in geocentric {crs}; reproject it to a projected CRS in metres")
    north_first = horizontal.axis_info[0].direction == "north"
    remark = None
    if place is not None:
        east, north = place[::-1] if north_first else place
        if not _covers(horizontal, east, north):
            swap = _covers(horizontal, north, east)
            remark = "frames whose axes are swapped" if swap else "frames far from the area they are made for"
            north_first = north_first != swap
    unit = horizontal.axis_info[0].unit_conversion_factor
    heights = [axis for frame in frames for axis in frame.axis_info if axis.direction in ("up", "down")]
    if horizontal.is_projected or not horizontal.is_geographic:
        scale, vertical = (unit, unit), unit  # feet both ways where no vertical frame says else
    else:
        latitude = (place[0] if north_first else place[1]) * unit if place is not None else 0.0
        metres = EARTH_RADIUS * unit
        scale, vertical = (metres * max(math.cos(latitude), 1e-3), metres), 1.0
    if heights:
        vertical = heights[0].unit_conversion_factor
    return Axes(crs, north_first, scale, vertical), remark


def _named(name: str) -> tuple[list[CRS], str]:
    """The frames that a name is made of, a horizontal one first, and that one's code; no frame where none is known."""
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    if "CRS84" in name:
        return [CRS.from_user_input("OGC:CRS84")], "OGC:CRS84"
    codes = _CODE.findall(name) or re.findall(r"^\s*(\d{4,6})\s*$", name)
    try:
        frames = [CRS.from_epsg(int(code)) for code in codes]
    except CRSError:
        return [], ""
    if not frames or (frames[0].is_vertical and not frames[0].is_compound):
        return [], ""
    return frames, f"EPSG:{int(codes[0])}"


def _covers(crs: CRS, east: float, north: float) -> bool:
    from pyproj import Transformer

    area = crs.area_of_use
    longitude, latitude = Transformer.from_crs(crs, LONLAT, always_xy=True).transform(east, north)
    if not (abs(longitude) <= 360.0 and abs(latitude) <= 90.0):
        return False
    if area is None:
        return True
    if not area.south - _MARGIN <= latitude <= area.north + _MARGIN:
        return False
    width = (area.east - area.west) % 360.0 or 360.0
    return (longitude - area.west + _MARGIN) % 360.0 <= width + 2 * _MARGIN
