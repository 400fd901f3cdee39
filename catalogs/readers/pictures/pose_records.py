"""Records of camera poses in tables and JSON, with the names of their pictures."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator
from itertools import chain, dropwhile
from typing import TypeAlias

from catalogs.readers.pictures.camera_angles import (
    camera_angles,
    camera_angles_from_rotation,
    parse_vector,
    rotation_matrix,
)
from catalogs.readers.pictures.pose_fields import FIELD_NAMES, field_name, find_field, squeeze
from catalogs.readers.pictures.source_poses import topocentric_transformer
from catalogs.readers.settings import PICTURES
from facade_core.core.json_types import JsonObject

_DECIMAL_COMMA = re.compile(r"^([+-]?\d+),(\d+)$")
# Members of JSON that hold the list of pictures, of KartaView and others one in another.
_LIST_KEYS = ("data", "features", "result", "osv", "photos", "images", "currentPageItems")
# Members of a record that hold its place.
_PLACE_KEYS = ("location", "position", "latLng", "gps")
# Entry of a poses file, or the error for which it cannot be used.
PoseRecord: TypeAlias = JsonObject | Exception


def csv_records(text: str) -> Iterator[tuple[str, PoseRecord]]:
    """Yield the rows of a table with the names of their pictures; a row that is unusable as an error."""
    lines, separator = _split_table(text)
    for row in csv.DictReader(lines, delimiter=separator):
        record = {key.strip(): (value or "").strip() for key, value in row.items() if isinstance(key, str)}
        if separator != ",":
            record = {key: _DECIMAL_COMMA.sub(r"\1.\2", value) for key, value in record.items()}
        if not any(record.values()) or next(iter(record.values())).startswith("#"):
            continue
        name = _picture_name(record)
        if any(map(str.strip, row.get(None, ()))):
            yield name, ValueError("it has more cells than the header; quote those with a separator")
        else:
            yield name, record


def _split_table(text: str) -> tuple[list[str], str]:
    """Return the lines of a table from its header on, and the separator of their cells."""
    lines = list(dropwhile(_precedes_header, text.splitlines()))
    header = lines[0].removeprefix("#") if lines else ""
    separator = max(",;\t", key=header.count)
    if separator not in header:
        return ["\t".join(line.split()) for line in (header, *lines[1:])], "\t"
    first = "".join(lines[1:2])
    if separator == "," and "\t" in first and "," not in first:  # as Metashape writes
        separator, header = "\t", "\t".join(cell.strip() for cell in header.split(","))
    return [header, *lines[1:]], separator


def _precedes_header(line: str) -> bool:
    return not line.strip() or (line.startswith(("#", "sep=")) and not _is_header(line))


def _is_header(line: str) -> bool:
    """Return True for a line that names fields; the header of some programs begins with # as comments do."""
    known = {squeeze(name) for names in FIELD_NAMES.values() for name in names}
    return sum(squeeze(field_name(cell)) in known for cell in re.split(r"[,;\t]", line.removeprefix("#"))) > 1


def json_records(content: JsonObject | list[JsonObject]) -> tuple[object, list[tuple[str, PoseRecord]]]:
    """Return the frame that JSON of poses states, and its records with the names of their pictures."""
    if isinstance(content, list):
        return _listed_records(content, None)
    if "camera_positions" in content:
        positions = content["camera_positions"].items()
        return content.get("crs"), [
            (name, {**dict(zip("xyz", p, strict=False)), "heading": 0.0}) for name, p in positions
        ]
    if "poses" in content:
        poses = content["poses"]
        named = poses.items() if isinstance(poses, dict) else ((_picture_name(record), record) for record in poses)
        return content.get("crs"), list(named)
    return _listed_records(_find_records(content) or [content], _geojson_crs(content))


def _listed_records(content: list[JsonObject], crs: str | None) -> tuple[str | None, list[tuple[str, PoseRecord]]]:
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
            and depth < PICTURES.max_list_depth
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
    return str(record[name]).replace("\\", "/")  # of any machine


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


def _reconstruction_shots(reconstruction: JsonObject) -> Iterable[tuple[str, PoseRecord]]:
    """Yield the equirectangular shots of an OpenSfM reconstruction (east, north, up around reference_lla)."""
    to_lonlat = topocentric_transformer(reconstruction["reference_lla"])
    for name, shot in reconstruction["shots"].items():
        try:
            camera = reconstruction["cameras"][shot["camera"]]
            if camera.get("projection_type") not in ("equirectangular", "spherical"):
                continue
            rotation = rotation_matrix(shot["rotation"])
            centre = -rotation.T @ parse_vector(shot["translation"])
            lon, lat, _ = to_lonlat.transform(centre[0], centre[1], centre[2])
            heading, pitch, roll = camera_angles(rotation)
        except (ValueError, TypeError, KeyError, AttributeError, ArithmeticError) as error:
            yield name, error
        else:
            # no height: its datum is that of GPS, not that of the block
            yield name, dict(lon=lon, lat=lat, heading=heading, pitch=pitch, roll=roll)
