"""Readers of camera poses: Streetloom's poses file and the output of capture and reconstruction tools."""

from __future__ import annotations

import csv
import json
import math
import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from datetime import date
from itertools import chain
from pathlib import Path
from typing import SupportsFloat, TypeAlias

import numpy as np

from catalogs.crs import LONLAT, has_east_north_axes, parse_crs
from catalogs.features import Remark
from catalogs.printable_text import short_repr
from catalogs.reader_errors import is_system_error, short_message, to_single_line
from catalogs.readers.pictures.pose_fields import (
    FIELD_NAMES,
    field_name,
    find_empty_fields,
    find_field,
    find_likely_units,
    find_unread_days,
    find_unused_fields,
    parse_capture_day,
    read_field,
    squeeze,
)
from facade_core.core.arrays import Float64Array
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject, JsonValue
from facade_core.core.regular_files import read_regular, require_regular

# Bytes; parsed JSON of nested lists takes twenty times its size.
MAX_FILE_BYTES = 40_000_000
# Largest magnitudes: metres of a position and above the sea, degrees of angles (cameras count headings beyond 360).
MAX_MAGNITUDES = {"x": 1e8, "y": 1e8, "z": 1e4, "heading": 3600.0, "pitch": 360.0, "roll": 360.0}
_FORMAT_HINT = 'a CSV with file,x,y,z,heading columns or JSON {"crs": ..., "poses": {"FILE": {"x", "y", "heading"}}}'
_DECIMAL_COMMA = re.compile(r"^([+-]?\d+),(\d+)$")
# Members of JSON that hold the list of pictures, of KartaView and others one in another.
_LIST_KEYS = ("data", "features", "result", "osv", "photos", "images", "currentPageItems")
_MAX_LIST_DEPTH = 3
# Members of a record that hold its place.
_PLACE_KEYS = ("location", "position", "latLng", "gps")
# Tilts of all panoramas of a file, degrees, that show another convention, and the least panoramas that show it.
_MAX_TILT_DEG = 10.0
_MIN_TILTED = 2
_NADIR_REASON = "pitches of {file} are all near 90: taken from straight down, as Metashape counts, and 90 taken off"
_UPSIDE_DOWN_REASON = (
    "rolls of {file} are all near 180, which turns the panoramas upside down; leave roll out if they are upright"
)
# Entry of a poses file, or the error for which it cannot be used.
PoseRecord: TypeAlias = JsonObject | Exception
# Value of an EXIF tag.
TagValue: TypeAlias = str | bytes | SupportsFloat | tuple[SupportsFloat, ...]


@dataclass(frozen=True, slots=True)
class SourcePose:
    """Camera pose in the coordinate system of its source.

    Attributes
    ----------
    crs : of x and y; None for the frame of the block.
    x : east, or longitude.
    y : north, or latitude.
    z : metres, None where it is unknown.
    heading : degrees clockwise from true north for a geographic crs, else from its grid north; None where it is unknown.
    pitch : degrees up.
    roll : degrees clockwise.
    captured : date as "2024-05-17", or None.
    remarks : reasons of remarks on it, such as what stands in place of an empty field.
    """

    crs: str | None
    x: float
    y: float
    z: float | None = None
    heading: float | None = None
    pitch: float = 0.0
    roll: float = 0.0
    captured: str | None = None
    remarks: tuple[str, ...] = field(default=(), compare=False)


@dataclass(frozen=True, slots=True)
class PosesFile:
    """Poses of a file.

    Attributes
    ----------
    poses : pose by the name of the picture, with or without suffix; a text with the defect replaces an unusable one.
    remarks : fields of the file that are not used.
    """

    poses: dict[str, SourcePose | str]
    remarks: tuple[Remark, ...] = ()


def read_poses_file(path: Path) -> PosesFile:
    """Read a poses file.

    Formats:
    - CSV with a header: file, x, y or lon, lat; heading (or yaw, azimuth, ...); optional z, pitch, roll. Separated by comma,
      semicolon or tab. Names may have units ("yaw_deg", "Heading[rad]", "z_ft"); FIELD_NAMES lists them.
    - JSON {"crs": "EPSG:...", "poses": {"file or stem": {x, y or lon, lat; heading; optional z, pitch, roll, captured}}}.
      Without crs, x and y are in the frame of the block; lon and lat are WGS 84.
    - JSON {"crs": ..., "camera_positions": {"stem": [x, y, z]}}: pictures whose centre faces grid north.
    - JSON list of {file, lat, lon, heading_deg, exif_gps: {GPSLatitude, GPSLatitudeRef, ..., GPSImgDirection}}, where GPS tags
      replace nulls.
    - GeoJSON points, or Mapillary image records (computed_geometry, computed_compass_angle, computed_rotation).
    - OpenSfM reconstruction.json: equirectangular shots with reference_lla.

    x is east or longitude, y north or latitude.

    Raises
    ------
    InputError
        For a file of another format.
    """
    try:
        require_regular(path)
        if path.stat().st_size > MAX_FILE_BYTES:
            raise InputError(
                f"{path} has more than {MAX_FILE_BYTES // 1_000_000} MB; keep the poses alone, without points and tracks"
            )
        content = read_regular(path, MAX_FILE_BYTES)
        text = content.decode("utf-16" if content.startswith((BOM_UTF16_LE, BOM_UTF16_BE)) else "utf-8-sig")
    except OSError as error:
        raise InputError(
            f"{path} cannot be read ({error.strerror}); give the file with the panoramas' poses"
        ) from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8 text; save it again as UTF-8: {_FORMAT_HINT}") from error
    try:
        if text.lstrip().startswith(("{", "[")):
            stated_crs, records = _json_records(json.loads(text, object_pairs_hook=_reject_duplicate_keys))
        else:
            stated_crs, records = None, list(csv_records(text))
    except Exception as error:  # libraries raise errors of any class
        if is_system_error(error):
            raise
        raise InputError(f"{path} is not a poses file ({short_message(error)}); give {_FORMAT_HINT}") from error
    crs = _check_crs(path, stated_crs)
    stated = {name: record for name, record in records if isinstance(record, dict)}
    empty = find_empty_fields(path.name, stated)
    poses: dict[str, SourcePose | str] = {}
    for name, record in records:
        if name in poses:
            poses[name] = f"{path.name} gives {name} twice; remove one"
            continue
        try:
            if isinstance(record, Exception):
                raise record
            poses[name] = replace(_parse_pose(record, crs), remarks=empty.get(name, ()))
        except (ValueError, TypeError, AttributeError, KeyError, IndexError, ArithmeticError) as error:
            problem = short_message(error)
            poses[name] = f"{path.name}: {to_single_line(name[:80])}: {to_single_line(problem)[:160]}; mend that entry"
    if not poses:
        raise InputError(f"{path} holds no poses; give {_FORMAT_HINT}")
    remarks = [
        remark
        for find in (find_unused_fields, find_likely_units, find_unread_days)
        for remark in find(path.name, stated.values())
    ]
    poses, tilted = _level_tilts(path.name, poses)
    return PosesFile(poses, (*remarks, *tilted))


def _level_tilts(file: str, poses: dict[str, SourcePose | str]) -> tuple[dict[str, SourcePose | str], list[Remark]]:
    """Return poses whose pitch is 0 at the horizon, and remarks on tilts that no panorama is taken with."""
    found = {name: pose for name, pose in poses.items() if isinstance(pose, SourcePose)}
    if len(found) < _MIN_TILTED:
        return poses, []
    remarks = []
    if all(abs(pose.pitch - 90.0) < _MAX_TILT_DEG for pose in found.values()):
        poses = poses | {name: replace(pose, pitch=pose.pitch - 90.0) for name, pose in found.items()}
        remarks.append(Remark("pitch", _NADIR_REASON.format(file=file), None))
    if all(abs(abs(pose.roll) - 180.0) < _MAX_TILT_DEG for pose in found.values()):
        remarks.append(Remark("roll", _UPSIDE_DOWN_REASON.format(file=file), None))
    return poses, remarks


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


def csv_records(text: str) -> Iterator[tuple[str, PoseRecord]]:
    """Yield the rows of a table with the names of their pictures; a row that is unusable as an error."""
    lines = text.splitlines()
    while lines and (not lines[0].strip() or (lines[0].startswith(("#", "sep=")) and not _is_header(lines[0]))):
        del lines[0]
    header = lines[0].removeprefix("#") if lines else ""
    separator = max(",;\t", key=header.count)
    if separator not in header:
        separator, header = "\t", "\t".join(header.split())
        lines = ["\t".join(line.split()) for line in lines]
    elif separator == "," and "\t" in "".join(lines[1:2]) and "," not in "".join(lines[1:2]):  # as Metashape writes
        separator, header = "\t", "\t".join(cell.strip() for cell in header.split(","))
    for row in csv.DictReader([header, *lines[1:]], delimiter=separator):
        record = {(key or "").strip(): (value or "").strip() for key, value in row.items() if isinstance(key, str)}
        if separator != ",":
            record = {key: _DECIMAL_COMMA.sub(r"\1.\2", value) for key, value in record.items()}
        if not any(record.values()) or next(iter(record.values())).startswith("#"):
            continue
        name = _picture_name(record)
        is_longer = any(map(str.strip, row.get(None) or ()))
        yield (
            name,
            ValueError("it has more cells than the header; quote those with a separator") if is_longer else record,
        )


def _is_header(line: str) -> bool:
    """Return True for a line that names fields; the header of some programs begins with # as comments do."""
    known = {squeeze(name) for names in FIELD_NAMES.values() for name in names}
    return sum(squeeze(field_name(cell)) in known for cell in re.split(r"[,;\t]", line.removeprefix("#"))) > 1


def _json_records(content: JsonObject | list[JsonObject]) -> tuple[object, list[tuple[str, PoseRecord]]]:
    if isinstance(content, dict) and "camera_positions" in content:
        positions = content["camera_positions"].items()
        return content.get("crs"), [
            (name, {**dict(zip("xyz", p, strict=False)), "heading": 0.0}) for name, p in positions
        ]
    if isinstance(content, dict) and "poses" in content:
        poses = content["poses"]
        named = poses.items() if isinstance(poses, dict) else ((_picture_name(record), record) for record in poses)
        return content.get("crs"), list(named)
    crs = _geojson_crs(content) if isinstance(content, dict) else None
    content = _find_records(content) or [content] if isinstance(content, dict) else content
    assert isinstance(content, list)
    if content and all("shots" in part for part in content):
        return None, list(chain.from_iterable(map(_reconstruction_shots, content)))
    return crs, [(_picture_name(record), record) for record in (_flatten_record(one, crs) for one in content)]


def _find_records(content: JsonObject, depth: int = 0) -> list[JsonObject] | None:
    """Return the list of pictures of an object, or of the objects in it."""
    for key in _LIST_KEYS:
        value = content.get(key)
        if isinstance(value, list):
            return value
        if (
            isinstance(value, dict)
            and depth < _MAX_LIST_DEPTH
            and (found := _find_records(value, depth + 1)) is not None
        ):
            return found
    return None


def _geojson_crs(content: JsonObject) -> str | None:
    """Return the frame that GeoJSON of before 2016 states; None for longitude and latitude."""
    stated = content.get("crs")
    name = (stated.get("properties") or {}).get("name") if isinstance(stated, dict) else None
    return name if isinstance(name, str) and "CRS84" not in name and not name.endswith("4326") else None


def _picture_name(record: JsonObject) -> str:
    name = find_field(record, "file")
    if name is None:
        raise ValueError("an entry does not name its picture")
    return str(record[name]).replace("\\", "/").rpartition("/")[2]  # folders of any machine


def _flatten_record(record: JsonObject, crs: str | None = None) -> JsonObject:
    """Return a GeoJSON feature or Mapillary record with coordinates and properties as plain fields.

    crs : frame of the coordinates, None for longitude and latitude.
    """
    flat = {**record, **(record.get("properties") or {})}
    for key in _PLACE_KEYS:
        flat = {**nested, **flat} if isinstance(nested := flat.get(key), dict) else flat
    if isinstance(flat.get("MAPCompassHeading"), dict):  # of mapillary_tools
        flat["heading"] = flat.pop("MAPCompassHeading").get("TrueHeading")
    place = flat.get("computed_geometry") or flat.get("geometry")
    if place:
        names = ("lon", "lat") if crs is None else ("x", "y")
        flat |= dict(zip((*names, "altitude of the point"), place["coordinates"], strict=False))
    if flat.get("computed_rotation"):
        flat |= dict(
            zip(("heading", "pitch", "roll"), camera_angles_from_rotation(flat["computed_rotation"]), strict=True)
        )
    return flat


def _parse_pose(record: JsonObject, crs: str | None) -> SourcePose:
    """Return a record as a pose; ValueError with the missing or invalid field."""
    if not isinstance(record, dict):
        raise ValueError("it is no object in braces")
    value = {
        key: _finite_number(read_field(record, key, crs), key) for key in FIELD_NAMES if key not in ("file", "captured")
    }
    x, y, heading = value["x"], value["y"], value["heading"]
    lon, lat = value["lon"], value["lat"]
    gps = record.get("exif_gps") or {}
    if (lon is None or lat is None) and "GPSLongitude" in gps and "GPSLatitude" in gps:
        lon = degrees_from_dms(gps["GPSLongitude"], gps.get("GPSLongitudeRef"))
        lat = degrees_from_dms(gps["GPSLatitude"], gps.get("GPSLatitudeRef"))
    tagged = _finite_number(gps.get("GPSImgDirection"), "GPSImgDirection")
    # the list's own heading is the tag rounded to whole degrees
    if tagged is not None and (heading is None or abs(tagged - heading) <= 0.5):
        heading = tagged
    if lon is not None and lat is not None:
        x, y, crs = lon, lat, LONLAT
    if x is None or y is None:
        raise ValueError("neither x and y nor lon and lat are given")
    return SourcePose(
        crs,
        x,
        y,
        value["z"],
        heading,
        value["pitch"] or 0.0,
        value["roll"] or 0.0,
        parse_capture_day(record[taken] if (taken := find_field(record, "captured")) else None),
    )


def parse_iso_date(time: object) -> str | None:
    """Return the date of a time such as "2024-05-17T10:15:00Z"; None without one."""
    try:
        return date.fromisoformat(time[:10]).isoformat() if isinstance(time, str) and time[4:5] == "-" else None
    except ValueError:
        return None


def _finite_number(value: object, key: str) -> float | None:
    if value is None:
        return None
    try:
        number = float(value) if isinstance(value, str | SupportsFloat) and not isinstance(value, bool) else math.nan
    except (ValueError, TypeError, ArithmeticError):
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"{key} is {short_repr(value)}, not a finite number")
    return number


def find_implausible_value(pose: SourcePose) -> str | None:
    """Return a value of a pose that no camera can have; None where all are plausible."""
    for key, most in MAX_MAGNITUDES.items():
        value = getattr(pose, key)
        if value is not None and not abs(value) <= most:
            return f"{key} is {value:g}, and at most {most:g} either way can be"
    return None


def _reconstruction_shots(reconstruction: JsonObject) -> Iterable[tuple[str, PoseRecord]]:
    """Yield the equirectangular shots of an OpenSfM reconstruction (east, north, up around reference_lla)."""
    from pyproj import Transformer

    reference = reconstruction["reference_lla"]
    found = [_finite_number(reference.get(key), key) for key in ("longitude", "latitude")]
    if None in found:
        raise ValueError("its reference_lla states no longitude or no latitude")
    place = [value or 0.0 for value in (*found, _finite_number(reference.get("altitude"), "altitude"))]
    if not (abs(place[0]) <= 360.0 and abs(place[1]) <= 90.0 and abs(place[2]) <= MAX_MAGNITUDES["z"]):
        raise ValueError(f"its reference_lla {short_repr(place)} is no place on earth")
    to_lonlat = Transformer.from_pipeline(
        "+proj=pipeline +step +inv +proj=topocentric +ellps=WGS84"
        f" +lon_0={place[0]} +lat_0={place[1]} +h_0={place[2]}"
        " +step +inv +proj=cart +ellps=WGS84 +step +proj=unitconvert +xy_in=rad +xy_out=deg"
    )
    for name, shot in reconstruction["shots"].items():
        try:
            camera = reconstruction["cameras"][shot["camera"]]
            if camera.get("projection_type") not in ("equirectangular", "spherical"):
                continue
            rotation = _rotation_matrix(shot["rotation"])
            centre = -rotation.T @ _parse_vector(shot["translation"])
            lon, lat, _ = to_lonlat.transform(centre[0], centre[1], centre[2])
            heading, pitch, roll = camera_angles(rotation)
        except (ValueError, TypeError, KeyError, AttributeError, ArithmeticError) as error:
            yield Path(name).name, error
        else:
            # no height: its datum is that of GPS, not that of the block
            yield Path(name).name, dict(lon=lon, lat=lat, heading=heading, pitch=pitch, roll=roll)


def _parse_vector(values: Iterable[float]) -> Float64Array:
    found = np.array([_finite_number(value, "a rotation or translation") for value in values], np.float64)
    if found.shape != (3,) or not (np.abs(found) <= MAX_MAGNITUDES["x"]).all():
        raise ValueError(f"{short_repr(found.tolist())} is no rotation or translation; three numbers are")
    return found


def camera_angles_from_rotation(axis_angle: Iterable[float]) -> tuple[float, float, float]:
    """Return heading, pitch and roll of a camera in degrees by its rotation.

    Parameters
    ----------
    axis_angle : camera_from_world rotation vector in radians; the world is east, north, up.

    Raises
    ------
    ValueError
        For an invalid vector.
    """
    return camera_angles(_rotation_matrix(axis_angle))


def _rotation_matrix(axis_angle: Iterable[float]) -> Float64Array:
    """Return the camera_from_world rotation (3, 3) of an axis-angle vector in radians."""
    import cv2

    return np.asarray(cv2.Rodrigues(_parse_vector(axis_angle).reshape(3, 1))[0], np.float64)


def camera_angles(camera_from_world: Float64Array) -> tuple[float, float, float]:
    """Return heading, pitch and roll in degrees of a camera: x right, y down, z forward; world east, north, up."""
    right, _, forward = camera_from_world
    heading = math.atan2(forward[0], forward[1])
    pitch = math.asin(min(max(forward[2], -1.0), 1.0))
    level = np.array([math.cos(heading), -math.sin(heading), 0.0])
    roll = math.atan2(-right @ np.cross(level, forward), right @ level)
    return math.degrees(heading) % 360.0, math.degrees(pitch), math.degrees(roll)


def _check_crs(path: Path, crs: object) -> str | None:
    """Return the coordinate system of a file as text; InputError for an unusable one."""
    if crs is None:
        return None
    text = str(crs) if isinstance(crs, int) and not isinstance(crs, bool) else crs
    if not isinstance(text, str):
        raise InputError(f"{path}: crs is {short_repr(crs)}, which is no name of a frame; give e.g. EPSG:4326")
    name = f"EPSG:{text}" if text.isdigit() else text
    try:
        found = parse_crs(name)
    except InputError as error:
        raise InputError(f"{path}: crs {error}") from error
    if not has_east_north_axes(found):
        raise InputError(
            f"{path}: crs {name} ({found.name}) has axes other than east and north; give one that has these"
        )
    return name


def _reject_duplicate_keys(pairs: list[tuple[str, JsonValue]]) -> JsonObject:
    """Raise ValueError for repeated keys, of which JSON would keep the last."""
    found: JsonObject = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twin = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"{short_repr(twin)} is given twice; remove one")
    return found
