"""Ways and areas of the ground in the block's frame, from OpenStreetMap tags."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely import LineString

from catalogs.block.streets import project_lines
from catalogs.buildings.surroundings import build_ground_objects
from catalogs.features import CentrelinesAndGround, natural_sort_key
from catalogs.readers.settings import LIMITS
from catalogs.readers.vectors.centrelines import is_building_passage
from catalogs.readers.vectors.lengths import parse_length
from facade_core.core.street_objects import stated_object_kind
from facade_core.core.types import GroundArea, GroundObject, GroundWay, MappedGround

if TYPE_CHECKING:
    from pyproj import CRS
    from shapely import Polygon
    from shapely.geometry.base import BaseGeometry

# Class of a road -> lane width in metres, default number of lanes, rank; "" if no class is stated.
ROAD_CLASSES = {
    "motorway": (3.6, 2, 9),
    "trunk": (3.5, 2, 8),
    "primary": (3.4, 2, 7),
    "secondary": (3.25, 2, 6),
    "tertiary": (3.2, 2, 5),
    "unclassified": (3.0, 2, 4),
    "residential": (3.0, 2, 3),
    "": (3.5, 2, 3),
    "living_street": (2.75, 2, 2),
    "service": (3.2, 1, 1),
}
# Classes of roads without pavement unless one is stated.
CLASSES_WITHOUT_PAVEMENT = frozenset(("motorway", "trunk", "service", "living_street"))
# Class of a way without carriageway -> kind, width in metres, surface.
PATH_CLASSES = {
    "pedestrian": ("path", 6.0, "slabs"),
    "footway": ("path", 2.2, "slabs"),
    "path": ("path", 1.8, "gravel"),
    "bridleway": ("path", 2.5, "gravel"),
    "track": ("path", 2.8, "gravel"),
    "steps": ("steps", 2.5, "slabs"),
    "cycleway": ("cycle", 2.5, "asphalt"),
}
# Surface -> values of the tag `surface`.
_TAG_VALUES_BY_SURFACE = {
    "asphalt": "asphalt chipseal concrete",
    "slabs": "paving_stones concrete:plates concrete:lanes bricks brick wood metal tiles",
    "setts": "sett cobblestone unhewn_cobblestone cobblestone:flattened",
    "gravel": "gravel fine_gravel compacted unpaved ground dirt earth sand pebblestone woodchips mud",
    "grass": "grass grass_paver artificial_turf",
}
SURFACE_BY_TAG_VALUE = {
    value: surface for surface, values in _TAG_VALUES_BY_SURFACE.items() for value in values.split()
}
# Surface of an area by its tags, the first match wins; its `surface` replaces those other than grass and water.
AREA_SURFACES: tuple[tuple[str, Mapping[str, str]], ...] = (
    (
        "natural",
        {"water": "water", "wood": "grass", "scrub": "grass", "grassland": "grass", "sand": "gravel", "beach": "gravel"},
    ),
    ("leisure", {"park": "grass", "garden": "grass", "pitch": "gravel", "playground": "gravel", "dog_park": "grass"}),
    (
        "landuse",
        {"grass": "grass", "meadow": "grass", "forest": "grass", "village_green": "grass", "flowerbed": "grass",
         "recreation_ground": "grass", "cemetery": "grass", "basin": "water", "construction": "gravel", "brownfield": "gravel"},
    ),
    ("waterway", {"riverbank": "water", "dock": "water"}),
    ("man_made", {"bridge": "slabs", "pier": "slabs"}),
    ("place", {"square": "slabs"}),
    ("amenity", {"parking": "asphalt"}),
    ("highway", {"pedestrian": "slabs", "footway": "slabs", "service": "asphalt", "rest_area": "asphalt"}),
    ("area:highway", {"pedestrian": "slabs", "footway": "slabs", "residential": "asphalt", "cycleway": "track"}),
)  # fmt: skip
DEFAULT_PAVEMENT_WIDTH_M = 2.5
# Width of a parking lane by orientation.
PARKING_WIDTH_M = {"parallel": 2.1, "diagonal": 4.3, "perpendicular": 5.0, "half_on_kerb": 1.1}
# Cycle track along a road.
CYCLE_TRACK_WIDTH_M = 1.8
# Verge between cycle track and kerb.
VERGE_WIDTH_M = 0.4
MAX_ROAD_WIDTH_M = 40.0
# Reach of a crossing to either side of its node.
MAX_CROSSING_REACH_M = 15.0
# Distance of a crossing's node from its road.
MAX_CROSSING_OFFSET_M = 1.0


def build_block_ground(
    sources: Sequence[CentrelinesAndGround], crs: CRS, around: Polygon, outline: Polygon | None
) -> MappedGround:
    """Build a block's ways, areas and objects of the ground within a polygon from map features.

    Tunnels and the undersides of bridges are left out, and so are broken features: a broken street is already a
    fault. If two sources have a feature of the same id, the second is numbered.

    Parameters
    ----------
    sources : centreline sources with the ground features that they state.
    crs : metric frame of the block.
    around : polygon in `crs` that features are clipped to.
    outline : where the block ends, None if unknown.
    """
    ways: list[GroundWay] = []
    street: dict[str, str] = {}
    areas: list[GroundArea] = []
    objects: list[GroundObject] = []
    nodes: list[tuple[str, shapely.Point]] = []
    placed = []
    for source in sources:
        geometries = project_lines([feature.geometry for feature in source.ground], source.crs, crs)
        placed += list(zip(source.ground, geometries, strict=True))
    placed.sort(key=lambda pair: (natural_sort_key(pair[0].id), shapely.to_wkb(pair[0].geometry) or b""))
    seen: Counter[str] = Counter()
    for feature, geometry in placed:
        seen[feature.id] += 1
        id = feature.id if seen[feature.id] == 1 else f"{feature.id}-{seen[feature.id]}"
        tags = feature.tags
        if geometry is None or _is_hidden(tags) or not _is_usable(geometry):
            continue
        objects += build_ground_objects(id, geometry, tags, around)
        if geometry.geom_type == "Point":
            if tags.get("highway") == "crossing" and _is_marked(tags) and around.contains(geometry):
                nodes.append((id, geometry))
        elif (surface := ground_surface_class(geometry, tags)) is not None:
            areas += _clipped_areas(id, geometry, surface, around)
        elif "LineString" in geometry.geom_type and tags.get("area") != "yes" and _may_be_way(tags):
            for line in _parts_within(geometry, around, "LineString"):
                found = ways_from_tags(id, line, tags)
                objects += _plausible_objects(found, tags)
                ways += found
                street[id] = f"{tags.get('highway')} {tags.get('name', id)}"
    ways = _equalise_widths(ways, street)
    roads = [way for way in ways if way.kind == "road"]
    ways += [crossing for id, node in nodes if (crossing := _node_crossing(id, node, roads)) is not None]
    return MappedGround(tuple(ways), tuple(areas), outline, tuple(objects))


def _plausible_objects(ways: Sequence[GroundWay], tags: Mapping[str, str]) -> list[GroundObject]:
    """Return what roads have in all likelihood: lamps where they are lit, cars where these park along the kerb."""
    roads = [way for way in ways if way.kind == "road"]
    lamps = [way for way in roads if tags.get("lit") == "yes"]
    parked = [way for way in roads if PARKING_WIDTH_M["parallel"] in way.parking]
    return [
        GroundObject(way.id, way.line, kind, is_stated=False)
        for kind, having in (("street_lamp", lamps), ("parked_car", parked))
        for way in having
    ]


def _may_be_way(tags: Mapping[str, str]) -> bool:
    """Return whether a line may be a way: fences and rows of trees are none, unless they lie on one."""
    return stated_object_kind(tags) is None or "highway" in tags or "railway" in tags


def _is_usable(geometry: BaseGeometry) -> bool:
    return not geometry.is_empty and bool((np.abs(shapely.get_coordinates(geometry)) < LIMITS.max_coordinate).all())


def _parts_within(geometry: BaseGeometry, around: Polygon, kind: str) -> list[BaseGeometry]:
    """Return the parts of a geometry within a polygon that are of a type and have a length."""
    parts = shapely.get_parts(shapely.intersection(geometry, around))
    return [part for part in parts if part.geom_type == kind and part.length > 0]


def _clipped_areas(id: str, geometry: BaseGeometry, surface: str, around: Polygon) -> list[GroundArea]:
    """Return the area of an outline or a closed line within a polygon; none outside."""
    outlined = geometry if "Polygon" in geometry.geom_type else shapely.Polygon(geometry.coords)
    parts = [part for part in _parts_within(shapely.make_valid(outlined), around, "Polygon") if part.area > 0]
    return [GroundArea(id, shapely.multipolygons(parts), surface)] if parts else []


def ways_from_tags(id: str, line: LineString, tags: Mapping[str, str]) -> list[GroundWay]:
    """Build the ways of a line from its tags: road with cycle tracks, path, tram or crossing."""
    if tags.get("railway") in ("tram", "light_rail"):
        gauge = _length_tag(tags, "gauge", 1435.0) or 1435.0
        return [GroundWay(id, line, "tram", min(max(gauge, 600.0), 1700.0) / 1000, "asphalt")]
    stated = tags.get("highway", "" if "railway" not in tags else "none")
    name = stated.removesuffix("_link")
    if name == "footway" and tags.get("footway") == "crossing":
        return [GroundWay(id, line, "crossing", 3.0, "asphalt")] if _is_marked(tags) else []
    if name == "footway" and tags.get("footway") == "sidewalk":
        return []  # part of its road's pavement
    if name in PATH_CLASSES:
        kind, wide, made = PATH_CLASSES[name]
        width = _length_tag(tags, "width", MAX_ROAD_WIDTH_M)
        return [GroundWay(id, line, kind, width or wide, _surface_from_tags(tags, made), width is None)]
    return _road_ways(id, line, name, tags) if name in ROAD_CLASSES else []


def _road_ways(id: str, line: LineString, name: str, tags: Mapping[str, str]) -> list[GroundWay]:
    lane, usual, rank = ROAD_CLASSES[name]
    oneway = tags.get("oneway") in ("yes", "true", "True", "1", "-1")
    lanes = _parse_lane_count(tags.get("lanes", ""))
    parking = (_parking_width(tags, "left"), _parking_width(tags, "right"))
    stated = _length_tag(tags, "width:carriageway", MAX_ROAD_WIDTH_M) or _length_tag(tags, "width", MAX_ROAD_WIDTH_M)
    width = stated or lane * (lanes or (1 if oneway and usual == 2 else usual)) + sum(parking)
    if oneway and stated is None and not lanes:
        width = max(width, 4.0)
    if sum(parking) > width - 2.2:
        parking = (0.0, 0.0)
    marked = lanes if rank >= 4 or tags.get("lane_markings") == "yes" else 0
    if tags.get("lane_markings") == "no":
        marked = 0
    pavement = tuple(_pavement_width(tags, side, name) for side in ("left", "right"))
    surface = _surface_from_tags(tags, "asphalt")
    road = GroundWay(
        id, line, "road", round(width, 2), surface, stated is None and not lanes, marked or 0, oneway,
        (pavement[0], pavement[1]), parking, rank,
    )  # fmt: skip
    tracks = []
    for side, name_of in ((1.0, "left"), (-1.0, "right")):
        if _side_tag(tags, "cycleway", name_of) == "track":
            beside = shapely.offset_curve(
                line, side * (width / 2 + VERGE_WIDTH_M + CYCLE_TRACK_WIDTH_M / 2), join_style="mitre"
            )
            for index, part in enumerate(shapely.get_parts(beside)):
                if part.length > 0:
                    tracks.append(GroundWay(f"{id}-{name_of}-{index}", part, "cycle", CYCLE_TRACK_WIDTH_M, "track"))
    return [road, *tracks]


def ground_surface_class(geometry: BaseGeometry, tags: Mapping[str, str]) -> str | None:
    """Return the surface class of a closed outline, such as "grass"; None if it is no area of ground."""
    if not _is_closed(geometry) or "building" in tags or len(shapely.get_coordinates(geometry)) < 4:
        return None
    for key, surfaces in AREA_SURFACES:
        made = surfaces.get(tags.get(key, ""))
        if made is None or (key == "highway" and tags.get("area") != "yes" and tags[key] != "pedestrian"):
            continue
        return made if made in ("grass", "water") else _surface_from_tags(tags, made)
    return None


def _is_closed(geometry: BaseGeometry) -> bool:
    return "Polygon" in geometry.geom_type or (
        geometry.geom_type in ("LineString", "LinearRing") and geometry.is_closed
    )


def _equalise_widths(ways: Sequence[GroundWay], street: Mapping[str, str]) -> list[GroundWay]:
    """Give roads of one name and class their most common width, so that kerbs run on.

    Tags such as parking change from piece to piece.
    """
    lengths: dict[str, dict[float, float]] = {}
    for way in ways:
        if way.kind == "road":
            of_width = lengths.setdefault(street[way.id], {})
            of_width[way.width] = of_width.get(way.width, 0.0) + way.line.length
    usual = {name: max(widths, key=lambda width: (widths[width], width)) for name, widths in lengths.items()}
    return [
        replace(
            way,
            width=usual[street[way.id]],
            parking=way.parking if sum(way.parking) < usual[street[way.id]] - 2.2 else (0.0, 0.0),
        )
        if way.kind == "road"
        else way
        for way in ways
    ]


def _node_crossing(id: str, node: shapely.Point, roads: Sequence[GroundWay]) -> GroundWay | None:
    """Return a crossing that is mapped as a node, as a line across its road."""
    if not roads:
        return None
    away = shapely.distance([way.line for way in roads], node)
    line = roads[int(np.argmin(away))].line
    if away.min() > MAX_CROSSING_OFFSET_M:
        return None
    along = line.project(node)
    ends = shapely.get_coordinates(
        shapely.line_interpolate_point(line, [max(along - 2.0, 0.0), min(along + 2.0, line.length)])
    )
    east, north = (ends[1] - ends[0]) / max(float(np.hypot(*(ends[1] - ends[0]))), 1e-9) * MAX_CROSSING_REACH_M
    # limited to its own road: a parallel carriageway has a crossing of its own
    reach = min(1.0, (max(way.width for way in roads if way.line is line) / 2 + 0.5) / MAX_CROSSING_REACH_M)
    east, north = float(east * reach), float(north * reach)
    across = LineString([(node.x - north, node.y + east), (node.x + north, node.y - east)])
    return GroundWay(id, across, "crossing", 3.0, "asphalt") if across.length > 0 else None


def _is_hidden(tags: Mapping[str, str]) -> bool:
    """Return whether a feature is underground, covered or inside a building, and no way through one."""
    if is_building_passage(tags) and not {"highway", "railway"}.isdisjoint(tags):
        return False
    try:
        under = float(tags.get("layer", "0")) < 0 and tags.get("natural") != "water"
    except ValueError:
        under = False
    return (
        under
        or tags.get("tunnel", "no") not in ("no", "F")
        or tags.get("indoor") == "yes"
        or tags.get("covered", "no") != "no"
    )


def _is_marked(tags: Mapping[str, str]) -> bool:
    return tags.get("crossing") not in ("unmarked", "no", "informal") and tags.get("crossing:markings") != "no"


def _surface_from_tags(tags: Mapping[str, str], default: str) -> str:
    return SURFACE_BY_TAG_VALUE.get(tags.get("surface", "").split(";")[0], default)


def _length_tag(tags: Mapping[str, str], key: str, maximum: float) -> float | None:
    found = parse_length(tags.get(key, ""))
    return found if found is not None and 0.5 <= found <= maximum else None


def _parse_lane_count(text: str) -> int | None:
    try:
        count = int(float(text.strip("[]'\" ").split(",")[0].split(";")[0].strip("'\" ")))
    except ValueError:
        return None
    return count if 1 <= count <= 10 else None


def _side_tag(tags: Mapping[str, str], key: str, side: str) -> str | None:
    return tags.get(f"{key}:{side}", tags.get(f"{key}:both", tags.get(key)))


def _pavement_width(tags: Mapping[str, str], side: str, name: str) -> float:
    """Return metres of pavement on one side of a road."""
    stated = tags.get(f"sidewalk:{side}", tags.get("sidewalk:both"))
    if stated is None and "sidewalk" in tags:
        both = tags["sidewalk"]
        stated = "yes" if both in ("both", "yes", "separate", side) else "no"
    if stated is None:
        width = _length_tag(tags, f"sidewalk:{side}:width", 15.0) or _length_tag(tags, "sidewalk:width", 15.0)
        stated = "no" if name in CLASSES_WITHOUT_PAVEMENT and width is None else "yes"
    if stated in ("no", "none"):
        return 0.0
    widths = (f"sidewalk:{side}:width", "sidewalk:both:width", "sidewalk:width")
    return next(
        (found for key in widths if (found := _length_tag(tags, key, 15.0)) is not None), DEFAULT_PAVEMENT_WIDTH_M
    )


def _parking_width(tags: Mapping[str, str], side: str) -> float:
    """Return metres of carriageway that parked cars take on one side of a road."""
    stated = _side_tag(tags, "parking", side)
    if stated in ("lane", "street_side"):
        both = tags.get("parking:both:orientation", tags.get("parking:orientation", "parallel"))
        return PARKING_WIDTH_M.get(tags.get(f"parking:{side}:orientation", both), PARKING_WIDTH_M["parallel"])
    lane = _side_tag(tags, "parking:lane", side)
    return PARKING_WIDTH_M.get(stated or ("parallel" if lane == "lane" else lane) or "", 0.0)
