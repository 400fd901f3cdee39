"""Readers of camera poses: Streetloom's poses file and the output of capture and reconstruction tools."""

from __future__ import annotations

import json
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from catalogs.crs import LONLAT, has_east_north_axes, parse_crs
from catalogs.features import Remark
from catalogs.printable_text import short_repr
from catalogs.reader_errors import short_message, to_single_line, wrap_reader_errors
from catalogs.readers.pictures.pose_fields import (
    find_empty_fields,
    find_field,
    find_unread_days,
    find_unused_fields,
    parse_capture_day,
    read_field,
)
from catalogs.readers.pictures.pose_records import PoseRecord, csv_records, json_records
from catalogs.readers.pictures.source_poses import SourcePose, TagValue, degrees_from_dms, finite_number
from catalogs.readers.settings import PICTURES
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject, JsonValue
from facade_core.core.regular_files import read_regular, require_regular

_NUMBER_FIELDS = ("x", "y", "z", "lon", "lat", "heading", "pitch", "roll")
_FORMAT_HINT = 'a CSV with file,x,y,z,heading columns or JSON {"crs": ..., "poses": {"FILE": {"x", "y", "heading"}}}'


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
    text = _read_text(path)
    with wrap_reader_errors(path, "is not a poses file", f"give {_FORMAT_HINT}"):
        if text.lstrip().startswith(("{", "[")):
            stated_crs, records = json_records(json.loads(text, object_pairs_hook=_reject_duplicate_keys))
        else:
            stated_crs, records = None, list(csv_records(text))
    crs = _check_crs(path, stated_crs)
    stated = {name: record for name, record in records if isinstance(record, dict)}
    empty = find_empty_fields(path.name, stated)
    poses: dict[str, SourcePose | str] = {}
    for name, record in records:
        repeated = f"{path.name} gives {name} twice; remove one"
        poses[name] = repeated if name in poses else _read_pose(path.name, name, record, crs, empty.get(name, ()))
    if not poses:
        raise InputError(f"{path} holds no poses; give {_FORMAT_HINT}")
    remarks = [remark for find in (find_unused_fields, find_unread_days) for remark in find(path.name, stated.values())]
    return PosesFile(poses, tuple(remarks))


def _read_text(path: Path) -> str:
    try:
        require_regular(path)
        if path.stat().st_size > PICTURES.max_poses_bytes:
            raise InputError(
                f"{path} has more than {PICTURES.max_poses_bytes // 1_000_000} MB; keep the poses alone, without "
                "points and tracks"
            )
        content = read_regular(path, PICTURES.max_poses_bytes)
        return content.decode("utf-16" if content.startswith((BOM_UTF16_LE, BOM_UTF16_BE)) else "utf-8-sig")
    except OSError as error:
        raise InputError(
            f"{path} cannot be read ({error.strerror}); give the file with the panoramas' poses"
        ) from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8 text; save it again as UTF-8: {_FORMAT_HINT}") from error


def _read_pose(
    file: str, name: str, record: PoseRecord, crs: str | None, remarks: tuple[tuple[str, str], ...]
) -> SourcePose | str:
    """Return the pose of a record, or the defect for which it cannot be used."""
    try:
        if isinstance(record, Exception):
            raise record
        return replace(_parse_pose(record, crs), remarks=remarks)
    except (ValueError, TypeError, AttributeError, KeyError, IndexError, ArithmeticError) as error:
        problem = short_message(error)
        return f"{file}: {to_single_line(name[:80])}: {to_single_line(problem)[:160]}; mend that entry"


def _parse_pose(record: JsonObject, crs: str | None) -> SourcePose:
    """Return a record as a pose; ValueError with the missing or invalid field."""
    if not isinstance(record, dict):
        raise ValueError("it is no object in braces")
    value = {key: finite_number(read_field(record, key, crs), key) for key in _NUMBER_FIELDS}
    gps = record.get("exif_gps") or {}
    crs, x, y = _place(value, gps, crs)
    heading, tagged = value["heading"], finite_number(gps.get("GPSImgDirection"), "GPSImgDirection")
    # the list's own heading is the tag rounded to whole degrees
    if tagged is not None and (heading is None or abs(tagged - heading) <= 0.5):
        heading = tagged
    return SourcePose(
        crs,
        x,
        y,
        value["z"],
        heading,
        value["pitch"],
        value["roll"],
        parse_capture_day(record[taken] if (taken := find_field(record, "captured")) else None),
    )


def _place(
    value: Mapping[str, float | None], gps: Mapping[str, TagValue], crs: str | None
) -> tuple[str | None, float | None, float | None]:
    """Return frame, x and y: longitude and latitude of fields, else of EXIF's tags, else x and y in `crs`.

    A record without a place counts angles from true north.
    """
    lon, lat, x, y = (value[key] for key in ("lon", "lat", "x", "y"))
    if lon is not None and lat is not None:
        return LONLAT, lon, lat
    if "GPSLongitude" in gps and "GPSLatitude" in gps:
        lon = degrees_from_dms(gps["GPSLongitude"], gps.get("GPSLongitudeRef"))
        return LONLAT, lon, degrees_from_dms(gps["GPSLatitude"], gps.get("GPSLatitudeRef"))
    if x is not None and y is not None:
        return crs, x, y
    if any(place is not None for place in (lon, lat, x, y)) or all(one is None for one in value.values()):
        raise ValueError("neither x and y nor lon and lat are given")
    return LONLAT, None, None


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
