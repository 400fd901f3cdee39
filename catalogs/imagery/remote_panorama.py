"""Panorama that a service or a folder offers, before it is fetched."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

from catalogs.crs import LONLAT
from catalogs.features import Fault
from catalogs.reader_errors import to_single_line
from catalogs.readers.pictures.source_poses import SourcePose, find_implausible_value, is_on_earth, parse_iso_date
from facade_core.core.errors import InputError

# West, south, east, north in degrees.
LonLatBox = tuple[float, float, float, float]
# Field of view of a full panorama.
FULL_TURN_DEG = 360.0
# STAC's words for licences without an identifier.
_UNSPECIFIC_LICENCES = ("", "proprietary", "other", "various")
_MANUAL_POSE_REMEDY = "give its pose in a poses file, and fetch it from a folder"


@dataclass(frozen=True, slots=True)
class PanoramaQuery:
    """Query for panoramas.

    Attributes
    ----------
    box : (west, south, east, north) in degrees.
    dates : span as STAC writes it, such as "2023-01-01/2024-12-31", ".." for an open end; None for any time.
    licence : of pictures that state none, if the user knows it.
    frame : CRS of places that a folder's poses file states without one.
    """

    box: LonLatBox
    dates: str | None = None
    licence: str | None = None
    frame: str = LONLAT

    def __post_init__(self) -> None:
        west, south, east, north = self.box
        if not (-180 <= west < east <= 180 and -90 <= south < north <= 90):
            text = " ".join(f"{value:g}" for value in self.box)
            raise InputError(
                f"--bbox {text}: is no box; give WEST SOUTH EAST NORTH in degrees, west < east, south < north"
            )
        ends = [] if self.dates is None else self.dates.split("/")
        if self.dates is not None and not (
            len(ends) == 2 and all(end == ".." or parse_iso_date(end) == end for end in ends)
        ):
            raise InputError(
                f"--dates {self.dates}: is no span; give FROM/TO such as 2023-01-01/2024-12-31 or 2025-01-01/.."
            )


@dataclass(frozen=True, slots=True)
class RemotePanorama:
    """Equirectangular panorama with a pose and a licence.

    Attributes
    ----------
    id : id in its service.
    url : address of its bytes; path of a folder's file.
    pose : place in degrees (WGS 84), heading from true north.
    captured : day, such as "2024-05-17", if stated.
    author : photographer, if stated.
    licence : identifier or words; None only for a folder's pictures.
    licence_url : address of the licence text, if stated.
    size : (rows, columns), if stated.
    sha256 : of its bytes, if stated.
    """

    id: str
    url: str
    pose: SourcePose
    captured: str | None = None
    author: str | None = None
    licence: str | None = None
    licence_url: str | None = None
    size: tuple[int, int] | None = None
    sha256: str | None = None


def panorama_fault(identifier: str, reason: str) -> Fault:
    """Return the fault of a panorama that is left out; one line with the remedy."""
    return Fault(to_single_line(identifier)[:80] or "unnamed", "panorama", to_single_line(reason)[:200])


def finite_float_or_none(value: object) -> float | None:
    """Return a value as float if it is a finite number, otherwise None."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:  # an integer of hundreds of digits
        return None
    return number if math.isfinite(number) else None


def image_size(dimensions: object) -> tuple[int, int] | None:
    """Return (rows, columns) from [columns, rows]; None for anything else."""
    found = [finite_float_or_none(value) for value in dimensions] if isinstance(dimensions, list) else []
    if len(found) != 2 or not found[0] or not found[1]:
        return None
    return int(found[1]), int(found[0])


def parse_geojson_pose(geometry: object, heading: object, pitch: object = None, roll: object = None) -> SourcePose:
    """Parse a GeoJSON point and angles in degrees into a pose.

    Raises
    ------
    ValueError : names the missing or invalid value, with the remedy.
    """
    point = geometry.get("coordinates") if isinstance(geometry, Mapping) else None
    lon, lat = (*map(finite_float_or_none, point[:2] if isinstance(point, list) else ()), None, None)[:2]
    if lon is None or lat is None:
        raise ValueError(f"states no place; {_MANUAL_POSE_REMEDY}")
    looks = finite_float_or_none(heading)
    if looks is None:
        raise ValueError(f"states a place but no heading; {_MANUAL_POSE_REMEDY}")
    if not is_on_earth(lon, lat):
        raise ValueError(f"states longitude {lon:g}, latitude {lat:g}, which is no place on earth; tell its service")
    pose = SourcePose(
        LONLAT, lon, lat, None, looks, finite_float_or_none(pitch) or 0.0, finite_float_or_none(roll) or 0.0
    )
    if problem := find_implausible_value(pose):
        raise ValueError(f"{problem}; tell its service")
    return pose


def resolve_licence(stated: object, text_url: str | None, user_licence: str | None) -> str:
    """Return the stated licence, or the address of its text, or the one the user knows.

    Raises
    ------
    ValueError : why the picture may not be used, with the remedy.
    """
    licence = stated if isinstance(stated, str) else ""
    if licence.lower() in _UNSPECIFIC_LICENCES and not text_url:
        if user_licence:
            return user_licence
        problem = f'says "{licence}" and names no text of a licence' if licence else "states no licence"
        raise ValueError(f"{problem}; ask who took it, and name what they say with --licence")
    if re.search(r"(?<![a-z])ND(?![a-z])", licence, re.IGNORECASE):
        raise ValueError(
            f"is under {licence}, which forbids changed copies, as textures are; ask who took it for another"
        )
    return licence or str(text_url)
