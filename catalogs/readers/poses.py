"""Files that say where pictures were taken: a poses file of our own, or what capture and reconstruction tools write."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from facade_core.errors import InputError

LONLAT = "EPSG:4326"
_NAMES = {
    "file": ("file", "filename", "image", "picture", "name", "id"),
    "x": ("x", "easting"),
    "y": ("y", "northing"),
    "z": ("z",),
    "lon": ("lon", "lng", "longitude"),
    "lat": ("lat", "latitude"),
    "heading": ("heading", "heading_deg", "computed_compass_angle", "compass_angle", "view:azimuth", "azimuth"),
    "pitch": ("pitch", "pers:pitch"),
    "roll": ("roll", "pers:roll"),
}
_FORMATS = 'a CSV with file,x,y,z,heading columns or JSON {"crs": ..., "poses": {"FILE": {"x", "y", "heading"}}}'


@dataclass(frozen=True, slots=True)
class SourcePose:
    """A pose in its source's frame: crs None is the block's own; heading None where only the place is known.

    heading is clockwise from true north where crs is geographic, else from that frame's grid north; angles in degrees, z in
    metres or None.
    """

    crs: str | None
    x: float
    y: float
    z: float | None = None
    heading: float | None = None
    pitch: float = 0.0
    roll: float = 0.0


def read_poses(path: Path) -> dict[str, SourcePose | str]:
    """Poses by the name of the picture (with or without suffix); in place of a pose that cannot be used, what is wrong with it.

    Understood are
    - CSV with a header: file, x, y or lon, lat; heading; optional z, pitch, roll. Separated by comma, semicolon or tab.
    - JSON {"crs": "EPSG:...", "poses": {"file or stem": {x, y or lon, lat; heading; optional z, pitch, roll}}}. Without crs,
      x and y are in the block's frame; lon and lat are WGS 84.
    - JSON {"crs": ..., "camera_positions": {"stem": [x, y, z]}}: pictures whose centre looks to grid north.
    - a JSON list of {file, lat, lon, heading_deg, exif_gps: {GPSLatitude, GPSLatitudeRef, ..., GPSImgDirection}}, where the
      GPS tags stand in for what is null.
    - GeoJSON points, or Mapillary's image records (computed_geometry, computed_compass_angle, computed_rotation).
    - OpenSfM's reconstruction.json: equirectangular shots with reference_lla.

    x is east or longitude, y north or latitude. Raises InputError for a file that is none of these.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(
            f"{path} cannot be read ({error.strerror}); give the file with the panoramas' poses"
        ) from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8 text; give {_FORMATS}") from error
    try:
        if text.lstrip().startswith(("{", "[")):
            crs, records = _json_records(json.loads(text))
        else:
            crs, records = None, list(_csv_records(text))
    except (ValueError, TypeError, AttributeError, KeyError, RecursionError, csv.Error) as error:
        raise InputError(f"{path} is not a poses file ({error}); give {_FORMATS}") from error
    _check_frame(path, crs)
    poses: dict[str, SourcePose | str] = {}
    for name, record in records:
        if name in poses:
            poses[name] = f"{path.name} gives {name} twice; remove one"
            continue
        try:
            poses[name] = record if isinstance(record, SourcePose) else _pose(record, crs)
        except (ValueError, TypeError, AttributeError) as error:
            poses[name] = f"{path.name}: {name}: {error}; mend that entry"
    if not poses:
        raise InputError(f"{path} holds no poses; give {_FORMATS}")
    return poses


def dms_degrees(value: Any, reference: Any) -> float:
    """Degrees of an EXIF coordinate: a number, or degrees, minutes and seconds; negative for the references S and W."""
    parts = value if isinstance(value, list | tuple) else [value]
    total = sum(float(part) / 60**power for power, part in enumerate(parts))
    letter = (reference.decode("ascii", "ignore") if isinstance(reference, bytes) else str(reference or "")).strip(
        "\0 "
    )
    return -total if letter.upper()[:1] in ("S", "W") else total


def _csv_records(text: str) -> Iterator[tuple[str, Any]]:
    header = text.split("\n", 1)[0]
    separator = max(",;\t", key=header.count)
    for row in csv.DictReader(text.splitlines(), delimiter=separator):
        record = {(key or "").strip().lower(): (value or "").strip() for key, value in row.items() if key}
        if any(record.values()):
            yield _name(record), record


def _json_records(content: Any) -> tuple[str | None, list[tuple[str, Any]]]:
    if isinstance(content, dict) and "camera_positions" in content:
        positions = content["camera_positions"].items()
        return content.get("crs"), [
            (name, {**dict(zip("xyz", p, strict=False)), "heading": 0.0}) for name, p in positions
        ]
    if isinstance(content, dict) and "poses" in content:
        poses = content["poses"]
        named = poses.items() if isinstance(poses, dict) else ((_name(record), record) for record in poses)
        return content.get("crs"), list(named)
    if isinstance(content, dict):
        lists = [content[key] for key in ("data", "features") if isinstance(content.get(key), list)]
        content = lists[0] if lists else [content]
    if content and all("shots" in part for part in content):
        return None, list(chain.from_iterable(map(_shots, content)))
    return None, [(_name(record), record) for record in map(_flat, content)]


def _name(record: Mapping[str, Any]) -> str:
    name = _first(record, "file")
    if name is None:
        raise ValueError("an entry does not name its picture")
    return Path(str(name)).name


def _first(record: Mapping[str, Any], key: str) -> Any:
    return next((record[name] for name in _NAMES[key] if record.get(name) not in (None, "")), None)


def _flat(record: dict[str, Any]) -> dict[str, Any]:
    """A GeoJSON feature or Mapillary record with its coordinates and properties as plain fields."""
    flat = {**record, **(record.get("properties") or {})}
    place = flat.get("computed_geometry") or flat.get("geometry")
    if place:
        flat |= dict(zip(("lon", "lat"), place["coordinates"], strict=False))
    if flat.get("computed_rotation"):
        flat |= dict(zip(("heading", "pitch", "roll"), _angles(_rotation(flat["computed_rotation"])), strict=True))
    return flat


def _pose(record: Mapping[str, Any], crs: str | None) -> SourcePose:
    """A record as a pose; ValueError saying what is missing or not a number."""
    value = {key: _number(_first(record, key), key) for key in _NAMES if key != "file"}
    x, y, heading = value["x"], value["y"], value["heading"]
    lon, lat = value["lon"], value["lat"]
    gps = record.get("exif_gps") or {}
    if (lon is None or lat is None) and "GPSLongitude" in gps and "GPSLatitude" in gps:
        lon = dms_degrees(gps["GPSLongitude"], gps.get("GPSLongitudeRef"))
        lat = dms_degrees(gps["GPSLatitude"], gps.get("GPSLatitudeRef"))
    tagged = _number(gps.get("GPSImgDirection"), "GPSImgDirection")
    # the list's own heading is the tag rounded to whole degrees
    if tagged is not None and (heading is None or abs(tagged - heading) <= 0.5):
        heading = tagged
    if lon is not None and lat is not None:
        x, y, crs = lon, lat, LONLAT
    if x is None or y is None:
        raise ValueError("neither x and y nor lon and lat are given")
    return SourcePose(crs, x, y, value["z"], heading, value["pitch"] or 0.0, value["roll"] or 0.0)


def _number(value: Any, key: str) -> float | None:
    if value is None:
        return None
    try:
        number = float(value)
    except (ValueError, TypeError):
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"{key} is {value!r}, not a finite number")
    return number


def _shots(reconstruction: Mapping[str, Any]) -> Iterable[tuple[str, Any]]:
    """Equirectangular shots of an OpenSfM reconstruction, whose world is east, north, up around reference_lla."""
    from pyproj import Transformer

    reference = reconstruction["reference_lla"]
    to_lonlat = Transformer.from_pipeline(
        "+proj=pipeline +step +inv +proj=topocentric +ellps=WGS84"
        f" +lon_0={float(reference['longitude'])} +lat_0={float(reference['latitude'])}"
        f" +h_0={float(reference.get('altitude') or 0.0)}"
        " +step +inv +proj=cart +ellps=WGS84 +step +proj=unitconvert +xy_in=rad +xy_out=deg"
    )
    for name, shot in reconstruction["shots"].items():
        camera = reconstruction["cameras"][shot["camera"]]
        if camera.get("projection_type") not in ("equirectangular", "spherical"):
            continue
        rotation = _rotation(shot["rotation"])
        east, north, up = -rotation.T @ np.asarray(shot["translation"], np.float64)
        lon, lat, _ = to_lonlat.transform(east, north, up)
        heading, pitch, roll = _angles(rotation)
        # heights are left out: they are above the GPS's datum, not the block's
        yield Path(name).name, dict(lon=lon, lat=lat, heading=heading, pitch=pitch, roll=roll)


def _rotation(axis_angle: Iterable[float]) -> np.ndarray:
    """The rotation (3, 3), camera_from_world, of an axis-angle vector in radians."""
    import cv2

    return cv2.Rodrigues(np.asarray(list(axis_angle), np.float64).reshape(3, 1))[0]


def _angles(camera_from_world: np.ndarray) -> tuple[float, float, float]:
    """Heading, pitch and roll in degrees of a camera with x right, y down, z forward in a world of east, north, up."""
    right, _, forward = camera_from_world
    heading = math.atan2(forward[0], forward[1])
    pitch = math.asin(min(max(forward[2], -1.0), 1.0))
    level = np.array([math.cos(heading), -math.sin(heading), 0.0])
    roll = math.atan2(-right @ np.cross(level, forward), right @ level)
    return math.degrees(heading) % 360.0, math.degrees(pitch), math.degrees(roll)


def _check_frame(path: Path, crs: Any) -> None:
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    if crs is None:
        return
    try:
        CRS.from_user_input(crs)
    except CRSError as error:
        raise InputError(f"{path}: crs {crs!r} is not known; give e.g. EPSG:4326") from error
