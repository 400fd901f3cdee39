"""A picture that a service or a folder has, as it says, before it is fetched."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from catalogs.features import Fault
from catalogs.reader_errors import single_line
from catalogs.readers.pictures.poses import LONLAT, SourcePose, find_implausible_value, parse_day
from facade_core.core.errors import InputError

# West, south, east, north in degrees.
Box = tuple[float, float, float, float]
# A full panorama sees all around, degrees.
ALL_AROUND = 360.0
# What STAC says of a licence that has no identifier.
_UNCLEAR = ("", "proprietary", "other", "various")
_BY_HAND = "give its pose in a poses file, and fetch it from a folder"


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a service is asked for.

    Args:
        box: where.
        dates: from when to when, as STAC writes it: "2023-01-01/2024-12-31", ".." for an open end; None whenever.
        licence: of pictures that state none, where whoever fetches them knows it.
        frame: of places that a folder's poses file gives without one.
    """

    box: Box
    dates: str | None = None
    licence: str | None = None
    frame: str = LONLAT

    def __post_init__(self) -> None:
        west, south, east, north = self.box
        if not (-180 <= west < east <= 180 and -90 <= south < north <= 90):
            said = " ".join(f"{value:g}" for value in self.box)
            raise InputError(
                f"--bbox {said}: is no box; give WEST SOUTH EAST NORTH in degrees, west < east, south < north"
            )
        ends = [] if self.dates is None else self.dates.split("/")
        if self.dates is not None and not (len(ends) == 2 and all(end == ".." or parse_day(end) == end for end in ends)):
            raise InputError(
                f"--dates {self.dates}: is no span; give FROM/TO such as 2023-01-01/2024-12-31 or 2025-01-01/.."
            )


@dataclass(frozen=True, slots=True)
class Offer:
    """An equirectangular panorama with a pose and a licence.

    Args:
        id: of its service.
        url: where its bytes are; of a folder the file's path.
        pose: place in degrees (WGS 84), heading from true north.
        captured: the day, as "2024-05-17"; None where that is not told.
        author: who took it, where told.
        licence: its identifier or words; None only of a folder's.
        licence_url: where its text is, where told.
        size: rows and columns, where told.
        sha256: of its bytes, where told.
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


def fault(identifier: str, reason: str) -> Fault:
    """A picture that is left out, in one line with the remedy."""
    return Fault(single_line(identifier)[:80] or "unnamed", "panorama", single_line(reason)[:200])


def number(value: Any) -> float | None:
    """A finite number, or None."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return float(value)


def placed(geometry: Any, heading: Any, pitch: Any = None, roll: Any = None) -> SourcePose:
    """The pose of a GeoJSON point and angles in degrees; ValueError says what is missing of it, with the remedy."""
    point = geometry.get("coordinates") if isinstance(geometry, Mapping) else None
    lon, lat = [number(value) for value in point[:2]] if isinstance(point, list) and len(point) >= 2 else (None, None)
    if lon is None or lat is None:
        raise ValueError(f"states no place; {_BY_HAND}")
    looks = number(heading)
    if looks is None:
        raise ValueError(f"states a place but no heading; {_BY_HAND}")
    if not (abs(lon) <= 360.0 and abs(lat) <= 90.0):
        raise ValueError(f"states longitude {lon:g}, latitude {lat:g}, which is no place on earth; tell its service")
    pose = SourcePose(LONLAT, lon, lat, None, looks, number(pitch) or 0.0, number(roll) or 0.0)
    if problem := find_implausible_value(pose):
        raise ValueError(f"{problem}; tell its service")
    return pose


def licensed(stated: Any, text: str | None, given: str | None) -> str:
    """The licence of a service's picture: as stated, with the address of its text where there is one, else as given by whoever
    fetches it. ValueError says why the picture may not be used, with the remedy."""
    licence = stated if isinstance(stated, str) else ""
    if licence.lower() in _UNCLEAR and not text:
        if given:
            return given
        said = f'says "{licence}" and names no text of a licence' if licence else "states no licence"
        raise ValueError(f"{said}; ask who took it, and name what they say with --licence")
    if re.search(r"(?<![a-z])ND(?![a-z])", licence, re.IGNORECASE):
        raise ValueError(
            f"is under {licence}, which forbids changed copies, as textures are; ask who took it for another"
        )
    return licence or str(text)
