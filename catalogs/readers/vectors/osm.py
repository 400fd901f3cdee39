"""Buildings and streets of an OpenStreetMap .pbf extract, read with pyrosm.

Tag meanings are those of the OSM wiki ("Simple 3D Buildings", "Key:highway").
"""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Callable, Collection, Container, Iterator, Mapping
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from catalogs.crs import LONLAT
from catalogs.features import CentrelinesAndGround, Fault, Footprint, Footprints, GroundFeature, Remark
from catalogs.reader_errors import fault_reason
from catalogs.readers.settings import VECTORS
from catalogs.readers.vectors.centrelines import build_centrelines, finite_points, is_building_passage
from catalogs.readers.vectors.colours import parse_building_finish
from catalogs.readers.vectors.lengths import is_unknown_code, parse_floor_count, parse_length
from catalogs.readers.vectors.osm_extracts import IncompleteFeatures, find_incomplete_features, open_osm_extract
from catalogs.readers.vectors.roofs import is_known_roof_shape, parse_roof, parse_roof_height, parse_roof_shape
from facade_core.core.street_objects import object_tag_values
from facade_core.core.types import Roof

if TYPE_CHECKING:
    from geopandas import GeoDataFrame
    from pyrosm import OSM
    from shapely.geometry.base import BaseGeometry

# Streets that a camera can travel between facades. Service roads are driveways and parking aisles, mostly inside blocks.
STREET_HIGHWAYS = frozenset((
    "residential", "unclassified", "tertiary", "secondary", "primary", "pedestrian", "living_street", "tertiary_link",
    "secondary_link", "primary_link",
))  # fmt: skip
OPEN_ROOF_VALUES = frozenset(("roof", "carport"))
_TRUE_WORDS = frozenset(("yes", "true", "1", "t", "y"))
# id, geometry and tags of a feature
_TaggedGeometry: TypeAlias = "tuple[str, BaseGeometry, dict[str, str]]"


def read_osm_footprints(path: Path, lod: str | None = None) -> Footprints:
    """Read the building outlines and building parts of a .pbf in lon/lat (EPSG:4326).

    The height reaches to the eaves: `height` less that of the roof. Roofs without walls and underground buildings are set
    aside, since extrusion from the ground would add walls.

    Parameters
    ----------
    path : file.
    lod : ignored, since outlines have no level of detail.

    Raises
    ------
    InputError
        Where the file is no readable .pbf.
    """
    remarks: list[Remark] = []
    items = []
    faults = []
    seen = set()
    layers, incomplete = _read_layers(path, lambda osm: osm.get_buildings(), _query_parts)
    remarks += _note_incomplete(path, incomplete, ("building", "building:part"))
    for feature, geometry, tags in chain.from_iterable(layers):
        if tags.get("building") == "no" or feature in seen:
            continue
        seen.add(feature)
        try:
            footprint = parse_footprint(feature, geometry, tags, remarks, is_lonlat=True)
        except Exception as error:  # an error affects this building only
            faults.append(Fault(feature, "building", fault_reason(error), finite_points(geometry)))
            continue
        if footprint is not None:
            items.append(footprint)
    return Footprints(LONLAT, tuple(items), tuple(remarks), tuple(faults))


def parse_footprint(
    feature: str, geometry: BaseGeometry, tags: Mapping[str, str], remarks: list[Remark], *, is_lonlat: bool
) -> Footprint | None:
    """Return the footprint of a tagged building; None where it cannot be extruded.

    Parameters
    ----------
    feature : id.
    geometry : outline.
    tags : OpenStreetMap tags.
    remarks : receives remarks on the building.
    is_lonlat : True for an outline in degrees, False for metres.
    """
    if reason := _exclusion_reason(geometry, tags):
        remarks.append(Remark(feature, f"{reason} set aside", geometry))
        return None
    height = parse_length(tags.get("height", ""))
    if (
        height is None
        or is_unknown_code(tags["height"])
        or not VECTORS.min_wall_height_m <= height <= VECTORS.max_tagged_height_m
    ):
        height = None
        if "height" in tags:
            remarks.append(Remark(f"{feature} ({tags['height']})", "heights not understood and ignored", geometry))
    roof = parse_roof(tags, geometry, is_lonlat=is_lonlat)
    if (shape := parse_roof_shape(tags)) and not is_known_roof_shape(shape):
        remarks.append(Remark(f"{feature} ({shape[:40]})", "roof shapes not understood and ignored", geometry))
    rise = parse_roof_height(tags) if roof is None else None
    has_eaves = VECTORS.min_wall_height_m <= (eaves := _length_tag(tags, "height:eaves")) <= VECTORS.max_tagged_height_m
    if has_eaves:
        if roof is None and height is not None and height > eaves:
            rise = round(height - eaves, 2)
        height = eaves
    elif height is not None:
        height, roof = _wall_height(height, roof, tags)
    levels = parse_floor_count(tags.get("building:levels", ""))
    if levels is None and "building:levels" in tags:
        remarks.append(
            Remark(f"{feature} ({tags['building:levels'][:40]})", "storeys not understood and ignored", geometry)
        )
    kind = tags.get("building", "").strip().lower()
    return Footprint(
        feature,
        geometry,
        height,
        levels,
        tags.get("name"),
        roof=roof,
        roof_height=rise if roof is None else None,
        is_eaves_height=has_eaves,
        use=kind if kind not in ("", "yes") else None,
        year_built=_parse_year(tags.get("start_date", "")),
        finish=parse_building_finish(tags),
        is_part=is_building_part(tags),
        min_height=_length_tag(tags, "min_height") or None,
        min_level=parse_floor_count(tags.get("building:min_level", "")),
        whole_id=stated_whole if (stated_whole := tags.get("building_id")) != feature else None,
        has_parts=_is_true(tags, "has_parts"),
    )


def is_building_part(tags: Mapping[str, str]) -> bool:
    """Return True for a building part, which may be tagged as a building too."""
    return tags.get("building:part", "no") != "no"


def _query_parts(osm: OSM) -> GeoDataFrame | None:
    wanted = {"building:part": True}
    return osm.get_data_by_custom_criteria(wanted, filter_type="keep", keep_nodes=False)


def _parse_year(text: str) -> int | None:
    """Return the latest year of a date such as "1936", "1890s", "1908..1939" and "after 1981"."""
    years = [int(found) for found in re.findall(r"(?<!\d)(1\d{3}|20\d{2})(?!\d)", text[:100])]
    return max(years, default=None)


def _wall_height(height: float, roof: Roof | None, tags: Mapping[str, str]) -> tuple[float, Roof | None]:
    """Return the height of the walls and the roof; `height` is tagged from the ground to the ridge.

    A tagged roof height that leaves no floor below is ignored; an assumed one is reduced.
    """
    tagged = parse_roof_height(tags)
    rise = roof.height if roof else tagged or 0.0
    if height - rise >= VECTORS.min_wall_height_m:
        return height - rise, roof
    left = height - VECTORS.min_wall_height_m
    if roof and tagged is None and left > 0.5:
        return VECTORS.min_wall_height_m, replace(roof, height=round(left, 2))
    return height, Roof("flat", 0.0)


# Filter of ground features besides the network of ways: areas, tracks, crossings.
_SURFACE_FILTER: dict[str, list[str]] = {
    "natural": ["water", "wood", "scrub", "grassland", "sand", "beach"],
    "leisure": ["park", "garden", "pitch", "playground", "dog_park"],
    "landuse": [
        "grass", "meadow", "forest", "village_green", "flowerbed", "recreation_ground", "cemetery", "basin",
        "construction", "brownfield",
    ],
    "waterway": ["riverbank", "dock"],
    "man_made": ["bridge", "pier"],
    "place": ["square"],
    "amenity": ["parking"],
    "railway": ["tram", "light_rail"],
    "highway": ["crossing", "pedestrian", "footway", "service"],
}  # fmt: skip
_OBJECT_FILTER = object_tag_values()
# Filter of all ground features.
_GROUND_FILTER: dict[str, list[str] | bool] = {
    key: [*_SURFACE_FILTER.get(key, ()), *_OBJECT_FILTER.get(key, ())] for key in {**_SURFACE_FILTER, **_OBJECT_FILTER}
} | {"area:highway": True}


def read_osm_centrelines(path: Path) -> CentrelinesAndGround:
    """Read the street centrelines and ground features of a .pbf in lon/lat (EPSG:4326).

    Raises
    ------
    InputError
        Where the file is no readable .pbf.
    """
    keep = {"filter_type": "keep", "keep_nodes": True, "keep_ways": True, "keep_relations": True}
    (ways, areas), incomplete = _read_layers(
        path,
        lambda osm: osm.get_network("all"),
        lambda osm: osm.get_data_by_custom_criteria(custom_filter=_GROUND_FILTER, **keep),
    )
    ground: list[GroundFeature] = []

    def streets() -> Iterator[tuple[str, BaseGeometry, str | None, Mapping[str, str]]]:
        for feature, geometry, tags in ways:
            ground.append(GroundFeature(feature, geometry, tags))
            for line in getattr(geometry, "geoms", [geometry]):
                if line is None or line.is_empty or not is_street(line, tags):
                    continue
                yield feature, line, tags.get("name"), tags

    found = build_centrelines(LONLAT, streets())
    known = {feature.id for feature in ground}
    for feature, geometry, tags in areas:
        if feature not in known or "Polygon" in geometry.geom_type:
            ground.append(GroundFeature(feature, geometry, tags))
    remarks = (*found.remarks, *_note_incomplete(path, incomplete, _GROUND_FILTER))
    return replace(found, ground=tuple(ground), remarks=remarks)


def is_street(line: BaseGeometry, tags: Mapping[str, str]) -> bool:
    """Return True where a camera can travel a `highway` above ground between facades."""
    above = tags.get("tunnel") not in ("yes", "T") and (_number_tag(tags, "layer") >= 0 or is_building_passage(tags))
    # a closed pedestrian way is the outline of a square, with or without area=yes
    square = line.is_ring and ("pedestrian" in tags["highway"] or tags.get("area") == "yes")
    return above and not square and not STREET_HIGHWAYS.isdisjoint(split_osmnx_values(tags["highway"]))


def split_osmnx_values(text: str) -> list[str]:
    """Return the values of an attribute that OSMnx writes as "['a', 'b']".

    A plain attribute is its only value.
    """
    if text.startswith("[") and len(text) < VECTORS.max_list_length:
        try:
            return [str(value) for value in ast.literal_eval(text)] or [""]
        except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):  # MemoryError: too deeply nested
            pass
    return [text]


def _read_layers(
    path: Path, *layers: Callable[[OSM], GeoDataFrame | None]
) -> tuple[list[Iterator[_TaggedGeometry]], IncompleteFeatures]:
    """Return (id, geometry, tags) of the features of each layer, way/12 as w12 and relation/12 as r12, and the others.

    Features with absent nodes or ways are left out.
    """
    from pyrosm import OSM

    with open_osm_extract(path) as readable:
        incomplete = find_incomplete_features(path, readable)
        osm = OSM(readable, progress=False)
        frames = [layer(osm) for layer in layers]
    return [_iterate_features(frame, incomplete.features) for frame in frames], incomplete


def _iterate_features(frame: GeoDataFrame | None, left_out: Container[str]) -> Iterator[_TaggedGeometry]:
    if frame is None:
        return
    for record in frame.drop(columns="geometry").assign(geometry=list(frame.geometry)).to_dict("records"):
        geometry = record.pop("geometry")
        feature = f"{str(record['osm_type'])[0]}{record['id']}"
        if feature not in left_out:
            yield feature, geometry, _record_tags(record)


def _note_incomplete(path: Path, incomplete: IncompleteFeatures, keys: Collection[str]) -> list[Remark]:
    """Return a remark on each feature with one of some tags that was left out."""
    reason = f"incomplete features of {path.name}, with missing nodes or ways, left out; {incomplete.remedy}"
    return [
        Remark(feature, reason, one.places)
        for feature, one in incomplete.features.items()
        if not one.tags.keys().isdisjoint(keys)
    ]


def _record_tags(record: dict[str, object]) -> dict[str, str]:
    """Return all tags of a feature; pyrosm keeps common ones as columns and others as JSON in `tags`."""
    rest = record.pop("tags", None)
    if isinstance(rest, str):
        rest = json.loads(rest)
    tags = {key: str(value) for key, value in rest.items()} if isinstance(rest, dict) else {}
    return tags | {key: value for key, value in record.items() if isinstance(value, str)}


def _exclusion_reason(geometry: BaseGeometry | None, tags: Mapping[str, str]) -> str | None:
    """Return the reason why a building cannot be extruded; None where it can."""
    if geometry is None or geometry.is_empty:
        return "buildings with an empty geometry"
    if geometry.geom_type not in ("Polygon", "MultiPolygon"):
        return "buildings that are no closed outlines"
    if tags.get("building") in OPEN_ROOF_VALUES or tags.get("building:part") in OPEN_ROOF_VALUES:
        return "roofs without walls"
    if _number_tag(tags, "layer") < 0 or tags.get("location") == "underground" or _is_true(tags, "is_underground"):
        return "buildings under ground"
    return None


def _is_true(tags: Mapping[str, str], key: str) -> bool:
    return tags.get(key, "").strip().lower() in _TRUE_WORDS


def _length_tag(tags: Mapping[str, str], key: str) -> float:
    return parse_length(tags.get(key, "")) or 0.0


def _number_tag(tags: Mapping[str, str], key: str) -> float:
    try:
        return float(tags.get(key, "0"))
    except ValueError:
        return 0.0
