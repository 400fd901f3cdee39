"""Reader of tables of cameras: position, omega-phi-kappa or yaw-pitch-roll, and focal length of each picture."""

from __future__ import annotations

import math
import re
from collections.abc import Callable

from catalogs.crs import LONLAT
from catalogs.reader_errors import wrap_reader_errors
from catalogs.readers.pictures.cameras.camera_file import (
    CameraFile,
    LensOfSize,
    SourceCamera,
    check_lens,
    check_position,
    entry_reason,
    rotation_from_heading,
    rotation_from_omega_phi_kappa,
)
from catalogs.readers.pictures.capture_dates import DIAGONAL_35MM
from catalogs.readers.pictures.pose_fields import read_field
from catalogs.readers.pictures.pose_records import PoseRecord, csv_records
from catalogs.readers.pictures.source_poses import finite_number
from catalogs.readers.settings import CAMERAS
from facade_core.core.arrays import Float64Array
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject
from facade_core.core.types import Lens

# Angles of photogrammetry, and degrees of their units.
_ANGLE = re.compile(r"^(omega|phi|kappa)[\s_.]*[\[(]?((?:deg|degrees?|°|rad|radians?|gon|grads?)?)[\])]?$")
_DEGREES = {"rad": math.degrees(1.0), "gon": 0.9, "gra": 0.9}
_FOCAL_NAMES = {
    "px": ("focal_px", "focal_length_px", "f_px", "focal_pixels", "focal"),
    "mm": ("focal_mm", "focal_length_mm", "f_mm"),
    "35mm": ("focal_35mm", "focal_length_35mm", "focal_length_in_35mm", "f35"),
}
_COEFFICIENTS = ("k1", "k2", "k3", "p1", "p2")
_HINT = "give file, x, y, z (or lon, lat), omega, phi, kappa (or heading, pitch, roll) and focal_px"


def read_camera_table(name: str, text: str, crs: str | None) -> CameraFile:
    """Read a CSV of cameras.

    Angles are in degrees where their field states no unit. omega, phi and kappa turn the axes of the frame of x and y;
    heading is clockwise from north, pitch is up from the horizon (-90 looks down), roll is clockwise. The focal length is
    focal_px (pixels), focal_mm with sensor_width_mm, or focal_35mm. Optional: width and height of the picture for which
    pixels count, cx, cy, k1, k2, k3, p1, p2 of OpenCV.

    Raises
    ------
    InputError
        Where it holds no camera.
    """
    with wrap_reader_errors(name, "is no table of cameras", _HINT):
        records = list(csv_records(text))
    if not records:
        raise InputError(f"{name} holds no rows; {_HINT}")
    if len(records) > CAMERAS.max_rows:
        raise InputError(f"{name} has more than {CAMERAS.max_rows} rows; give those of this block")
    cameras: dict[str, SourceCamera | str] = {}
    is_geographic = False
    for picture, record in records:
        if picture in cameras:
            cameras[picture] = f"{name} gives {picture} twice; remove one"
            continue
        try:
            camera, uses_lonlat = _camera(record, crs)
        except (ValueError, TypeError, OverflowError) as error:
            cameras[picture] = entry_reason(name, picture, error)
        else:
            cameras[picture] = camera
            is_geographic |= uses_lonlat
    return CameraFile(name, cameras, crs=LONLAT if is_geographic else crs)


def _camera(record: PoseRecord, crs: str | None) -> tuple[SourceCamera, bool]:
    """Return the camera of a row, and whether its position is longitude and latitude."""
    if isinstance(record, Exception):
        raise record
    value = {key: finite_number(read_field(record, key, crs), key) for key in ("x", "y", "z", "lon", "lat")}
    uses_lonlat = value["x"] is None or value["y"] is None
    east, north = (value["lon"], value["lat"]) if uses_lonlat else (value["x"], value["y"])
    if east is None or north is None:
        raise ValueError("neither x and y nor lon and lat are given")
    centre = check_position([east, north, value["z"] or 0.0])
    return SourceCamera(centre, _rotation(record, crs), _lens(record), value["z"] is not None), uses_lonlat


def _rotation(record: JsonObject, crs: str | None) -> Float64Array:
    """Return the rotation (3, 3) of omega, phi and kappa, else of heading, pitch and roll."""
    angles = {found[1]: (found[2], record[key]) for key in record if (found := _ANGLE.match(key.strip().lower()))}
    if len(angles) == 3:
        return rotation_from_omega_phi_kappa(*(_angle(which, *angles[which]) for which in ("omega", "phi", "kappa")))
    return rotation_from_heading(*_heading_pitch_roll(record, crs))


def _heading_pitch_roll(record: JsonObject, crs: str | None) -> tuple[float, float, float]:
    heading, pitch, roll = (finite_number(read_field(record, key, crs), key) for key in ("heading", "pitch", "roll"))
    if heading is None or pitch is None:
        raise ValueError("neither omega, phi and kappa nor heading and pitch are given")
    roll = roll or 0.0
    if abs(pitch) > 90 or abs(heading) > 720 or abs(roll) > 360:
        raise ValueError(
            f"heading {heading:g}, pitch {pitch:g}, roll {roll:g} are no degrees; where they are radians, "
            "call the fields heading_rad, pitch_rad, roll_rad"
        )
    return heading, pitch, roll


def _angle(name: str, unit: str, value: object) -> float:
    turn = finite_number(None if value == "" else value, name)
    if turn is None:
        raise ValueError(f"{name} is empty")
    degrees = turn * _DEGREES.get(unit[:3], 1.0)
    if abs(degrees) > 720:
        raise ValueError(f"{name} is {turn:g} {unit or 'degrees'}, more than two turns; check its unit")
    return degrees


def _lens(record: JsonObject) -> LensOfSize:
    """Return the lens of a row for the size of its picture."""
    fields = {str(key).strip().lower().replace(" ", "_"): content for key, content in record.items() if content != ""}
    focal_px = _focal_px(fields)
    stated_width, stated_height, cx, cy = (_number(fields, name) for name in ("width", "height", "cx", "cy"))
    k1, k2, k3, p1, p2 = (_number(fields, name) or 0.0 for name in _COEFFICIENTS)
    radial = (k1, k2, k3) if any((k1, k2, k3)) else ()
    stated = (int(stated_width), int(stated_height)) if stated_width and stated_height else None

    def lens_of_size(size: tuple[int, int]) -> Lens:
        width, height = stated or size
        pixels = focal_px(width, height)
        centre = (width / 2 if cx is None else cx, height / 2 if cy is None else cy)
        return check_lens(Lens((width, height), (pixels, pixels), centre, radial, (), (p1, p2)))

    return lens_of_size


def _focal_px(fields: JsonObject) -> Callable[[int, int], float]:
    """Return the focal length in pixels for a width and height."""
    unit, name = next(
        ((unit, name) for unit, names in _FOCAL_NAMES.items() for name in names if fields.get(name) is not None),
        ("px", "focal"),
    )
    focal = _number(fields, name)
    if focal is None:
        raise ValueError("no focal length is given: focal_px, focal_mm with sensor_width_mm, or focal_35mm")
    sensor = _number(fields, "sensor_width_mm")
    if unit == "35mm":
        return lambda width, height: focal / DIAGONAL_35MM * math.hypot(width, height)
    if unit == "mm":
        if not sensor:
            raise ValueError("focal_mm needs sensor_width_mm, the width of the sensor")
        return lambda width, _: focal / sensor * width
    if focal < CAMERAS.min_focal_px:
        raise ValueError(f"a focal length of {focal:g} pixels is none; call millimetres focal_mm, with sensor_width_mm")
    return lambda *_: focal


def _number(fields: JsonObject, name: str) -> float | None:
    return finite_number(fields.get(name), name)
