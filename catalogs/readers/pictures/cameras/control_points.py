"""Reader of control points: places that a local frame and the map both know."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from pyproj import CRS, Transformer

from catalogs.crs import LONLAT
from catalogs.printable_text import short_repr
from catalogs.reader_errors import short_message
from catalogs.readers.pictures.cameras.camera_file import SourceCamera, check_position
from catalogs.readers.pictures.picture_matches import find_names
from catalogs.readers.pictures.pose_fields import read_field
from catalogs.readers.pictures.pose_records import csv_records
from facade_core.core.arrays import Float64Array
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject
from facade_core.core.regular_files import read_regular

_HINT = "give name, model_x, model_y, model_z (or the name of a picture) and x, y, z (or lon, lat, z)"


def read_control_points(
    path: Path, cameras: Mapping[str, SourceCamera | str], frame: CRS, crs: str | None
) -> tuple[list[str], Float64Array, Float64Array]:
    """Read a table of control points.

    A row names a point with its place in the model, model_x, model_y, model_z, or a picture, whose camera is the point; and its
    place on the map, x, y (in `crs`, else in the frame of the block) or lon, lat, and z in metres in the datum of the ground.

    Returns
    -------
    Names, places in the model (n, 3), and places in the frame of the block (n, 3).

    Raises
    ------
    InputError
        For the first row that cannot be used.
    """
    names, source, target = [], [], []
    try:
        for name, record in csv_records(read_regular(path).decode("utf-8-sig")):
            if isinstance(record, Exception):
                raise record
            names.append(name)
            source.append(_model_place(name, record, cameras))
            target.append(_map_place(name, record, frame, crs))
    except (ValueError, TypeError, UnicodeError) as error:
        raise InputError(f"{path}: {short_message(error)}; {_HINT}") from error
    return names, np.array(source).reshape(-1, 3), np.array(target).reshape(-1, 3)


def _model_place(name: str, record: JsonObject, cameras: Mapping[str, SourceCamera | str]) -> Float64Array:
    stated = [record.get(f"model_{axis}") or None for axis in "xyz"]
    if None not in stated:
        return check_position([_number(name, value) for value in stated])
    found = [camera for one in find_names(name, cameras) if isinstance(camera := cameras[one], SourceCamera)]
    if len(found) > 1:
        raise ValueError(f"{name[:60]} is the name of {len(found)} pictures with cameras: name their folders too")
    if not found:
        raise ValueError(f"{name[:60]} has no model_x, model_y, model_z, and is no picture with a camera")
    return found[0].centre


def _map_place(name: str, record: JsonObject, frame: CRS, crs: str | None) -> Float64Array:
    value = {key: read_field(record, key, crs) for key in ("x", "y", "z", "lon", "lat")}
    if value["z"] is None:
        raise ValueError(f"{name[:60]} has no z")
    uses_lonlat = value["x"] is None or value["y"] is None
    east, north, up = (_number(name, value[key]) for key in (("lon", "lat", "z") if uses_lonlat else ("x", "y", "z")))
    origin = LONLAT if uses_lonlat else crs
    if origin is not None:
        east, north = Transformer.from_crs(CRS.from_user_input(origin), frame, always_xy=True).transform(east, north)
    return check_position([east, north, up])


def _number(name: str, value: object) -> float:
    try:
        return float(str(value))
    except ValueError:
        raise ValueError(f"{name[:60]} has {short_repr(value)} where a number is needed") from None
