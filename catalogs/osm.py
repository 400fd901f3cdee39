"""Buildings and streets out of an OpenStreetMap .pbf extract, read with pyrosm.

Tag meanings are those of the OSM wiki ("Simple 3D Buildings", "Key:highway").
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from catalogs.features import Centreline, Centrelines, Footprint, Footprints, Remark
from facade_core.errors import InputError

# Streets that a camera can travel between facades. Service roads are driveways and parking aisles, mostly inside blocks.
STREETS = frozenset(
    [
        "residential",
        "unclassified",
        "tertiary",
        "secondary",
        "primary",
        "pedestrian",
        "living_street",
        "tertiary_link",
        "secondary_link",
        "primary_link",
    ]
)
WITHOUT_WALLS = frozenset(("roof", "carport"))
_LENGTH = re.compile(r"(\d+(?:[.,]\d+)?)\s*(m|metres?|meters?|ft|feet|')?", re.IGNORECASE)
_FEET_INCHES = re.compile(r"(\d+)\s*'\s*(\d+(?:[.,]\d+)?)\s*(?:\"|'')")
_FOOT, _INCH = 0.3048, 0.0254


def parse_length(text: str) -> float | None:
    """Metres from an OSM length: "12", "12.5 m", "40 ft", 7'4"; None where it is not understood."""
    text = text.strip()
    if match := _FEET_INCHES.fullmatch(text):
        return int(match[1]) * _FOOT + float(match[2].replace(",", ".")) * _INCH
    if match := _LENGTH.fullmatch(text):
        value = float(match[1].replace(",", "."))
        return value * _FOOT if (match[2] or "").lower() in ("ft", "feet", "'") else value
    return None


def parse_levels(text: str) -> float | None:
    """Storeys from building:levels: "5", "3.5"; of a list such as "4;5" the largest; None where not understood."""
    try:
        levels = max(float(part.replace(",", ".")) for part in text.split(";"))
    except ValueError:
        return None
    return levels if 0 < levels < 300 else None


def read_footprints(path: Path) -> Footprints:
    """Every building outline of a .pbf, in lon/lat (EPSG:4326).

    The height is the one to the eaves: `height` less `roof:height` where both are tagged. Roofs without walls, buildings under
    ground and those that start above it (bridges, overhangs) are set aside, since extruding them from the ground would
    put walls where there are none. Raises InputError where the file is no readable .pbf.
    """
    remarks = []
    items = []
    for feature, geometry, tags in _features(path, lambda osm: osm.get_buildings()):
        if tags.get("building") == "no":
            continue
        if reason := _unusable(geometry, tags):
            remarks.append(Remark(feature, f"{reason} set aside", geometry))
            continue
        height = _eaves(tags)
        if height is None and "height" in tags:
            remarks.append(Remark(f"{feature} ({tags['height']})", "heights not understood and ignored", geometry))
        levels = parse_levels(tags.get("building:levels", ""))
        items.append(Footprint(feature, geometry, height, levels, tags.get("name")))
    return Footprints("EPSG:4326", tuple(items), tuple(remarks))


def read_centrelines(path: Path) -> Centrelines:
    """Every street centreline of a .pbf that a camera can travel above ground, in lon/lat (EPSG:4326).

    Raises InputError where the file is no readable .pbf.
    """
    items = []
    for feature, geometry, tags in _features(path, lambda osm: osm.get_network("all")):
        above = tags.get("tunnel") != "yes" and _number(tags, "layer") >= 0
        if tags.get("highway") not in STREETS or not above or geometry is None or geometry.is_empty:
            continue
        for line in getattr(geometry, "geoms", [geometry]):
            # a closed pedestrian way is the outline of a square, with or without area=yes
            if not (line.is_ring and (tags["highway"] == "pedestrian" or tags.get("area") == "yes")):
                items.append(Centreline(feature, line, tags.get("name")))
    return Centrelines("EPSG:4326", tuple(items))


def _features(path: Path, layer: Callable[[Any], Any]) -> Iterator[tuple[str, Any, dict[str, str]]]:
    """(id, geometry, tags) of each feature: way/12 -> w12, relation/12 -> r12."""
    with path.open("rb") as file:
        if b"OSMHeader" not in file.read(64):
            raise InputError(f"{path} is not an OSM .pbf file; export the area again as .osm.pbf")
    from pyrosm import OSM

    try:
        frame = layer(OSM(str(path)))
    except Exception as error:  # pyrosm lets zlib, struct, protobuf and its own errors through
        reason = " ".join(str(error).split())[:120]
        raise InputError(f"{path} cannot be read as OSM .pbf ({reason}); download it again") from error
    if frame is None:
        return
    for record in frame.drop(columns="geometry").assign(geometry=list(frame.geometry)).to_dict("records"):
        geometry = record.pop("geometry")
        yield f"{str(record['osm_type'])[0]}{record['id']}", geometry, _tags(record)


def _tags(record: dict[str, Any]) -> dict[str, str]:
    """All tags of a feature; pyrosm keeps the common ones as columns and the others as JSON in `tags`."""
    rest = record.pop("tags", None)
    if isinstance(rest, str):
        rest = json.loads(rest)
    tags = {key: str(value) for key, value in rest.items()} if isinstance(rest, dict) else {}
    return tags | {key: value for key, value in record.items() if isinstance(value, str)}


def _unusable(geometry: Any, tags: dict[str, str]) -> str | None:
    """Why a building cannot be extruded from the ground; None where it can."""
    if geometry is None or geometry.is_empty:
        return "buildings with an empty geometry"
    if geometry.geom_type not in ("Polygon", "MultiPolygon"):
        return "buildings that are no closed outlines"
    if tags.get("building") in WITHOUT_WALLS:
        return "roofs without walls"
    if _number(tags, "layer") < 0 or tags.get("location") == "underground":
        return "buildings under ground"
    if _metres(tags, "min_height") > 0 or _number(tags, "building:min_level") > 0:
        return "buildings that start above the ground"
    return None


def _eaves(tags: dict[str, str]) -> float | None:
    """Height of the walls; a roof height that leaves no storey under it is not believed."""
    height = parse_length(tags.get("height", ""))
    if height is None or not 2.0 <= height <= 1000.0:
        return None
    eaves = height - _metres(tags, "roof:height")
    return eaves if eaves >= 2.0 else height


def _metres(tags: dict[str, str], key: str) -> float:
    return parse_length(tags.get(key, "")) or 0.0


def _number(tags: dict[str, str], key: str) -> float:
    try:
        return float(tags.get(key, "0"))
    except ValueError:
        return 0.0
