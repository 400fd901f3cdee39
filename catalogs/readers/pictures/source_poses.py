"""Camera poses as their sources state them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import date
from typing import TYPE_CHECKING, SupportsFloat, TypeAlias

from catalogs.crs import LONLAT
from catalogs.printable_text import short_repr
from facade_core.core.json_types import JsonObject

if TYPE_CHECKING:
    from pyproj import Transformer

# Largest magnitudes: metres of a position and above the sea, degrees of angles (cameras count headings beyond 360).
MAX_MAGNITUDES = {"x": 1e8, "y": 1e8, "z": 1e4, "heading": 3600.0, "pitch": 360.0, "roll": 360.0}
# Value of an EXIF tag.
TagValue: TypeAlias = str | bytes | SupportsFloat | tuple[SupportsFloat, ...]


@dataclass(frozen=True, slots=True)
class SourcePose:
    """Camera pose in the coordinate system of its source; a field that the source does not state is None.

    Attributes
    ----------
    crs : of x and y; None for the frame of the block.
    x : east, or longitude.
    y : north, or latitude.
    z : metres.
    heading : degrees clockwise from true north for a geographic crs, else from its grid north.
    pitch : degrees up.
    roll : degrees clockwise.
    captured : date as "2024-05-17".
    has_true_heading : True for a heading from true north in any crs.
    remarks : fields, and reasons of remarks on them, such as what stands in place of an empty one.
    """

    crs: str | None
    x: float | None
    y: float | None
    z: float | None = None
    heading: float | None = None
    pitch: float | None = None
    roll: float | None = None
    captured: str | None = None
    has_true_heading: bool = False
    remarks: tuple[tuple[str, str], ...] = field(default=(), compare=False)


def assemble_pose(sources: Mapping[str, SourcePose]) -> tuple[SourcePose, dict[str, str]]:
    """Return a pose with each field from the first source that states it, and that source by field.

    Parameters
    ----------
    sources : pose by the name of its source, the best one first.
    """
    chosen = {
        key: name
        for key in ("x", "z", "heading", "pitch", "roll", "captured")
        for name, pose in reversed([*sources.items()])
        if getattr(pose, key) is not None
    }
    value = {key: getattr(sources[name], key) for key, name in chosen.items()}
    place = sources.get(chosen.get("x", ""), SourcePose(LONLAT, None, None))
    heading = sources.get(chosen.get("heading", ""), place)
    remarks = tuple(
        (key, reason) for name, pose in sources.items() for key, reason in pose.remarks if chosen.get(key, name) == name
    )
    return replace(
        place,
        **value,
        has_true_heading=heading.has_true_heading or (heading.crs == LONLAT != place.crs),
        remarks=remarks,
    ), chosen


def find_implausible_value(pose: SourcePose) -> str | None:
    """Return a value of a pose that no camera can have; None where all are plausible."""
    for key, most in MAX_MAGNITUDES.items():
        value = getattr(pose, key)
        if value is not None and not abs(value) <= most:
            return f"{key} is {value:g}, and at most {most:g} either way can be"
    return None


def is_on_earth(lon: float, lat: float, height: float = 0.0) -> bool:
    """Return True for a longitude, latitude and height in metres of a place on Earth."""
    return abs(lon) <= 360.0 and abs(lat) <= 90.0 and abs(height) <= MAX_MAGNITUDES["z"]


def topocentric_transformer(reference: JsonObject) -> Transformer:
    """Return the transformer from east, north and up around an OpenSfM reference_lla to longitude, latitude and height.

    Raises
    ------
    ValueError
        Where the reference is no place on Earth.
    """
    from pyproj import Transformer

    lon, lat, altitude = (finite_number(reference.get(key), key) for key in ("longitude", "latitude", "altitude"))
    if lon is None or lat is None:
        raise ValueError("its reference_lla states no longitude or no latitude")
    height = altitude or 0.0
    if not is_on_earth(lon, lat, height):
        raise ValueError(f"its reference_lla {short_repr([lon, lat, height])} is no place on earth")
    return Transformer.from_pipeline(
        f"+proj=pipeline +step +inv +proj=topocentric +ellps=WGS84 +lon_0={lon} +lat_0={lat} +h_0={height}"
        " +step +inv +proj=cart +ellps=WGS84 +step +proj=unitconvert +xy_in=rad +xy_out=deg"
    )


def finite_number(value: object, key: str) -> float | None:
    """Return a field as a number, None without one; ValueError for anything else."""
    if value is None:
        return None
    try:
        number = float(value) if isinstance(value, str | SupportsFloat) and not isinstance(value, bool) else math.nan
    except (ValueError, TypeError, ArithmeticError):
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"{key} is {short_repr(value)}, not a finite number")
    return number


def degrees_from_dms(value: TagValue | list[SupportsFloat], reference: TagValue | None) -> float:
    """Return the degrees of an EXIF coordinate, negative for S and W.

    The value is a number, or degrees, minutes and seconds.
    """
    parts = value if isinstance(value, list | tuple) else [value]
    total: float = sum(float(part) / 60**power for power, part in enumerate(parts))
    letter = (reference.decode("ascii", "ignore") if isinstance(reference, bytes) else str(reference or "")).strip(
        "\0 "
    )
    return -total if letter.upper()[:1] in ("S", "W") else total


def parse_iso_date(time: object) -> str | None:
    """Return the date of a time such as "2024-05-17T10:15:00Z"; None without one."""
    try:
        return date.fromisoformat(time[:10]).isoformat() if isinstance(time, str) and time[4:5] == "-" else None
    except ValueError:
        return None
