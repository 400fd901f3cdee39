"""Fields of poses files: names, units, and those that are stated and not used."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from datetime import UTC, date, datetime

from catalogs.crs import metres_per_height_unit, parse_crs
from catalogs.features import Remark
from catalogs.printable_text import escape_invisible
from catalogs.readers.settings import PICTURES
from facade_core.core.json_types import JsonObject

# Names of a field, lower-case, words joined by "_", without unit and namespace. The first stated one counts.
FIELD_NAMES = {
    "file": (
        "file", "filename", "file_name", "image", "image_name", "image_file", "picture", "photo", "photo_name", "panorama",
        "pano", "sourcefile", "source_file", "file_path", "photo_id", "image_id", "pano_id", "label", "name", "id",
    ),
    "x": ("x", "easting", "east", "x/easting", "x/east"),
    "y": ("y", "northing", "north", "y/northing", "y/north"),
    "z": ("z",),
    "lon": ("lon", "lng", "long", "longitude", "map_longitude", "gpslongitude", "gps_longitude", "x/longitude"),
    "lat": ("lat", "latitude", "map_latitude", "gpslatitude", "gps_latitude", "y/latitude"),
    "heading": (
        "heading", "computed_compass_angle", "compass_angle", "view_azimuth", "azimuth", "yaw", "bearing", "compass",
        "true_heading", "poseheading", "pose_heading", "gpsimgdirection", "gps_img_direction", "img_direction",
        "center_heading",
    ),
    "pitch": ("pitch", "pers_pitch", "posepitch", "pose_pitch"),
    "roll": ("roll", "pers_roll", "poseroll", "pose_roll"),
    "captured": (
        "captured", "captured_at", "capture_date", "capture_time", "date_taken", "datetimeoriginal", "datetime_original",
        "mapcapturetime", "shot_date", "date_added",
    ),
}  # fmt: skip
_ANGLE_KEYS = ("heading", "pitch", "roll", "lon", "lat")
# Units at the end of a field's name, "yaw_deg", "Heading[rad]", "Easting (m)", "z_ft", and their degrees or metres.
_ANGLE_UNITS = {"deg": 1.0, "°": 1.0, "rad": math.degrees(1.0), "gon": 0.9, "grad": 0.9}
_LENGTH_UNITS = {"mm": 0.001, "cm": 0.01, "km": 1000.0, "m": 1.0, "ft": 0.3048}
_UNIT = re.compile(
    r"[\s_.]*[\[(]?(?:(?P<deg>deg|degrees?|°)|(?P<gon>gon|grads?|gradians?)|(?P<rad>rad|radians?)"
    r"|(?P<ft>(?:us[-_ ]?|int[-_ ]?)?(?:ft|feet|foot)(?:us)?)|(?P<mm>mm)|(?P<cm>cm)|(?P<km>km)|(?P<m>m|met(?:er|re)s?))[\])]?$"
)
# Groups that ExifTool writes before the names of tags.
_NAMESPACE = re.compile(r"^(?:exif|xmp|xmp-\w+|composite|gps|gpano)\s*:\s*")
# What databases and tables write for an empty cell.
_EMPTY_WORDS = frozenset(("", "nan", "null", "none", "n/a", "-"))
# A latitude or longitude: hemisphere, degrees, minutes, seconds, hemisphere.
_SEXAGESIMAL = re.compile(
    r"\s*([NSEW])?\s*(\d+(?:[.,]\d+)?)\s*(?:°|º|deg|d|:)?"
    r"\s*(?:(\d+(?:[.,]\d+)?)\s*(?:'|′|’|m|min|:)?\s*(?:(\d+(?:[.,]\d+)?)\s*(?:\"|″|”|''|s|sec)?)?)?\s*([NSEW])?\s*",
    re.IGNORECASE,
)
_UNUSED_REASON = (
    "fields of {file} with numbers that are not used; call those meant z (with its unit: z_m, z_ft), heading, "
    "pitch or roll"
)
_DATE_REASON = "dates of {file} not understood, read without; write the day as 2024-05-17"
_DATE = re.compile(
    r"(?P<y>\d{4})[-:/_]?(?P<m>\d\d)[-:/_]?(?P<d>\d\d)(?:(?!\d)|(?=\d{6}(?!\d)))"
    r"|(?P<D>\d\d?)\.(?P<M>\d\d?)\.(?P<Y>\d{4})(?!\d)"
)
# Fields that a row may leave empty, and what a camera without it has.
_DEFAULTS = {"z": "height unknown", "pitch": "taken as 0", "roll": "taken as 0"}


def field_name(name: str) -> str:
    """Return a name of a field as FIELD_NAMES has it."""
    plain = _NAMESPACE.sub("", name.strip().lower())
    return re.sub(r"[\s:.-]+", "_", _UNIT.sub("", plain) or plain)


def find_field(record: JsonObject, key: str) -> str | None:
    """Return the name under which a record states a field; None without a value."""
    known: dict[str, str] = {}
    for stated, content in record.items():
        if _is_stated(content):
            known.setdefault(squeeze(field_name(stated)), stated)
    return next((known[name] for name in map(squeeze, FIELD_NAMES[key]) if name in known), None)


def squeeze(name: str) -> str:
    """Return a name without what joins its words: "image_name" and "imageName" are one."""
    return name.replace("_", "").lower()


def read_field(record: JsonObject, key: str, crs: str | None) -> object:
    """Return the value of a field, None without one: angles in degrees, z in metres, x and y in the unit of the crs.

    A value that is no number is returned as it is.
    """
    if (name := find_field(record, key)) is None:
        return None
    value: object = record[name]
    if isinstance(value, str) and key in _ANGLE_KEYS:
        value = value.rstrip("°º ")
        if key in ("lon", "lat") and (degrees := _parse_sexagesimal(value)) is not None:
            return degrees
    factor = _unit_factor(name, key, crs)
    if key in ("lon", "lat") and str(record.get(f"{name}Ref", ""))[:1].upper() in ("S", "W"):
        factor = -factor
    if factor == 1.0 or not isinstance(value, str | int | float) or isinstance(value, bool):
        return value
    try:
        return float(value) * factor
    except (ValueError, OverflowError):
        return value


def _parse_sexagesimal(text: str) -> float | None:
    """Return the degrees of a text such as 60°9'35.1"N, 60 deg 9' 35.10" N and 60.16 N; None for other texts."""
    match = _SEXAGESIMAL.fullmatch(text)
    if match is None or not (match[1] or match[3] or match[5]):
        return None
    degrees: float = sum(
        float((part or "0").replace(",", ".")) / 60.0**power for power, part in enumerate(match.group(2, 3, 4))
    )
    return -degrees if (match[1] or match[5] or "").upper() in ("S", "W") else degrees


def _unit_factor(name: str, key: str, crs: str | None) -> float:
    found = _UNIT.search(name.strip().lower())
    unit = found.lastgroup if found else None
    if key in _ANGLE_KEYS:
        return _ANGLE_UNITS.get(unit or "", 1.0)
    if key == "z":
        return _LENGTH_UNITS[unit] if unit in _LENGTH_UNITS else metres_per_height_unit(crs)
    if key in ("x", "y") and unit in _LENGTH_UNITS:
        factor = _LENGTH_UNITS[unit] / _metres_per_unit(crs)
        return factor if abs(factor - 1.0) > 1e-5 else 1.0  # feet of the survey are feet
    return 1.0


def _metres_per_unit(crs: str | None) -> float:
    """Return the metres per unit of x and y; 1 for degrees and for the frame of the block."""
    frame = None if crs is None else parse_crs(crs)
    return 1.0 if frame is None or frame.is_geographic else float(frame.axis_info[0].unit_conversion_factor)


def find_unused_fields(file: str, records: Iterable[JsonObject]) -> tuple[Remark, ...]:
    """Return a remark on each field that holds numbers and counts for no record; sizes of pictures are none."""
    names: dict[str, None] = {}
    used = set()
    for record in records:
        used |= {find_field(record, key) for key in FIELD_NAMES}
        names.update(dict.fromkeys(name for name, content in record.items() if _is_number(content)))
    unused = {name: field_name(name) for name in names if name not in used}
    sizes = {"width", "height"} if "width" in unused.values() else set()
    return tuple(
        Remark(escape_invisible(name)[: PICTURES.max_field_name_length], _UNUSED_REASON.format(file=file), None)
        for name, plain in unused.items()
        if plain not in sizes
    )


def parse_capture_day(value: object) -> str | None:
    """Return the day "2024-05-17" of a date, a time or seconds or milliseconds since 1970 in UTC; None for others.

    Dates begin with the year, or are days, months and years with points.
    """
    text = str(value).strip()
    if found := _DATE.match(text):
        year, month, day = found.group("y", "m", "d") if found["y"] else found.group("Y", "M", "D")
        try:
            return date(int(year), int(month), int(day)).isoformat()
        except ValueError:
            return None
    try:
        seconds = float(text)
    except ValueError:
        return None
    seconds = seconds / 1000 if seconds >= PICTURES.min_epoch_ms else seconds
    if not PICTURES.min_epoch_s <= seconds < PICTURES.max_epoch_s:
        return None
    return datetime.fromtimestamp(seconds, UTC).date().isoformat()


def find_unread_days(file: str, records: Iterable[JsonObject]) -> tuple[Remark, ...]:
    """Return a remark on the fields of dates that are not understood.

    Parameters
    ----------
    file : name of the file in the remark.
    records : records of the file.
    """
    stated = {(name, str(record[name])) for record in records if (name := find_field(record, "captured")) is not None}
    unread = sorted({name for name, text in stated if parse_capture_day(text) is None})
    return tuple(
        Remark(escape_invisible(name)[: PICTURES.max_field_name_length], _DATE_REASON.format(file=file), None)
        for name in unread
    )


def find_empty_fields(file: str, records: Mapping[str, JsonObject]) -> dict[str, tuple[tuple[str, str], ...]]:
    """Return the substitute values of fields that only some records state, by record.

    Parameters
    ----------
    file : name of the file in the reasons.
    records : records by name.

    Returns
    -------
    Name of a record -> fields, and reasons that group panoramas.
    """
    found: dict[str, tuple[tuple[str, str], ...]] = {}
    for key in ("heading", *_DEFAULTS):
        stated = {name: find_field(record, key) for name, record in records.items()}
        plain = {name: field_name(one) for name, one in stated.items() if one is not None}
        order = list(map(squeeze, FIELD_NAMES[key]))
        first = min(plain.values(), key=lambda one: order.index(squeeze(one)), default=None)
        if first is None:
            continue
        for name, field in stated.items():
            if plain.get(name) == first:
                continue
            if field is not None:
                substitute = f"{key} taken from {escape_invisible(field)[: PICTURES.max_field_name_length]}"
            elif key in _DEFAULTS:
                substitute = _DEFAULTS[key]
            else:
                continue
            reason = f"panoramas whose {first} is empty in {file}, {substitute}"
            found[name] = (*found.get(name, ()), (key, reason))
    return found


def _is_stated(content: object) -> bool:
    return content is not None and not (isinstance(content, str) and content.strip().lower() in _EMPTY_WORDS)


def _is_number(content: object) -> bool:
    if isinstance(content, bool) or not isinstance(content, str | int | float):
        return False
    try:
        return math.isfinite(float(content))
    except (ValueError, OverflowError):
        return False
