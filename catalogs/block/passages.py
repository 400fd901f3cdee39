"""Passages of streets and paths through buildings: opened in extruded buildings, closed in others.

Tag meanings are those of the OSM wiki ("Tag:tunnel=building_passage").
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely
from shapely import LineString, Polygon

from catalogs.block.ground import ground_surface_class, ways_from_tags
from catalogs.block.streets import project_lines
from catalogs.features import CentrelinesAndGround, format_reason_notes
from catalogs.readers.vectors.centrelines import is_building_passage
from catalogs.readers.vectors.lengths import parse_length
from facade_core.core.types import (
    MIN_PASSAGE_HEIGHT_M,
    MIN_WALL_OVER_PASSAGE_M,
    Building,
    BuildingPassage,
    ElevationRaster,
    GroundWay,
)
from facade_core.geometry.buildings.passages import has_closed_passage
from facade_core.geometry.ground.terrain import build_terrain

if TYPE_CHECKING:
    from pyproj import CRS
    from shapely.geometry.base import BaseGeometry

DEFAULT_PASSAGE_HEIGHT_M = 3.5
HEIGHT_RANGE_M = (1.8, 12.0)  # m; other values of `maxheight` are errors
WIDTH_RANGE_M = (2.0, 15.0)  # m
TRAM_WIDTH_M = 3.0
# Values of `maxheight` without a number.
UNKNOWN_HEIGHTS = frozenset(("default", "below_default", "none", "unsigned", "no_sign", "no_indications", "unknown"))
# Metres of a centreline in a building from which it passes through; less touches a corner.
MIN_CROSSING_M = 1.0
# Metres by which a mapped end of a passage may be short of the wall, besides half its width.
MAX_END_GAP_M = 2.0
# Metres that an area reaches beyond its building, since outlines are simplified later.
OUTLINE_MARGIN_M = 0.5
MIN_AREA_M2 = 0.1
# Square metres of an area in a building from which it passes through.
MIN_PASSAGE_AREA_M2 = 1.0
# Metres to which two lines of one way are equal in two sources.
EQUAL_LINES_M = 0.01

CLOSED_REASON = "passages through buildings closed, without viewpoints"
LOW_REASON = "passages through buildings too low for them closed, without viewpoints"
AREA_REASON = "passages through buildings drawn as areas closed; draw them as lines"
INNER_REASON = "passages that do not reach the walls of their buildings closed, without viewpoints"
NO_ROOM_REASON = "buildings with passages closed, as their walls are too low over the ground there"
OPENED_REASON = "passages through buildings opened"
ASSUMED_HEIGHT_REASON = f"passages through buildings opened to an assumed height of {DEFAULT_PASSAGE_HEIGHT_M:g} m"
UNREAD_HEIGHT_REASON = (
    f"heights of passages not understood, {DEFAULT_PASSAGE_HEIGHT_M:g} m assumed; write maxheight in metres"
)


class OpenedPassages(NamedTuple):
    """Buildings with their passages.

    Attributes
    ----------
    buildings : all buildings in their order.
    streets : centrelines without closed passages.
    reasons : ids of passages by note.
    """

    buildings: tuple[Building, ...]
    streets: CentrelinesAndGround
    reasons: Mapping[str, Sequence[str]]


class _PassageSize(NamedTuple):
    width: float
    height: float


class _PassageWay(NamedTuple):
    """Way through buildings in the block's frame: `street` is its index among the centrelines, None for other ways."""

    id: str
    shape: BaseGeometry
    tags: Mapping[str, str]
    street: int | None = None


def open_passages(
    buildings: Sequence[Building], streets: CentrelinesAndGround, sources: Sequence[CentrelinesAndGround], crs: CRS
) -> OpenedPassages:
    """Open the passages of streets and other ways through extruded buildings, and drop closed ones from the streets.

    A passage through several buildings is opened in all of them, or in none where one is a model or too low. A street that
    enters no building stays one.

    Parameters
    ----------
    streets : centrelines that carry viewpoints; a source without a frame is in the block's.
    sources : sources whose ground features are passages too, such as footways and streets that are not selected.
    crs : metric frame of the block.
    """
    reasons: dict[str, list[str]] = defaultdict(list)
    tree = shapely.STRtree([building.footprint for building in buildings])
    by_size: dict[_PassageSize, list[_PassageWay]] = defaultdict(list)
    areas: list[_PassageWay] = []
    for way in _passage_ways(streets, sources, crs):
        if isinstance(way.shape, LineString):
            by_size[_passage_size(way.id, way.shape, way.tags)].append(way)
        else:
            areas.append(way)
    if covering := [way.id for way in areas if _covers_building(way.shape, buildings, tree)]:
        reasons[AREA_REASON] = covering
    corridors: dict[int, list[BuildingPassage]] = defaultdict(list)
    closed: set[int] = set()
    for size, whole, members in _join_ways(by_size):
        crossed = _crossed_buildings(whole, buildings, tree)
        if not crossed:
            continue
        found = {index: _building_passages(whole, size, buildings[index]) for index in crossed}
        if reason := next((one for one in found.values() if isinstance(one, str)), None):
            reasons[reason] += [way.id for way in members]
            closed.update(way.street for way in members if way.street is not None)
            continue
        for index, own in found.items():
            corridors[index] += [passage for passage in own if isinstance(passage, BuildingPassage)]
        for way in members:
            reasons[_opening_note(way.tags)].append(way.id)
    opened = tuple(
        replace(building, passages=tuple(corridors[index])) if index in corridors else building
        for index, building in enumerate(buildings)
    )
    left = tuple(piece for index, piece in enumerate(streets.items) if index not in closed)
    return OpenedPassages(opened, replace(streets, items=left), reasons)


def _join_ways(
    by_size: Mapping[_PassageSize, Sequence[_PassageWay]],
) -> Iterator[tuple[_PassageSize, BaseGeometry, list[_PassageWay]]]:
    """Join the ways of each size that meet; yields size, line and members of each."""
    for size, ways in by_size.items():
        for whole in shapely.get_parts(shapely.line_merge(shapely.multilinestrings([way.shape for way in ways]))):
            yield size, whole, [way for way in ways if shapely.covers(whole, way.shape)]


def _covers_building(area: BaseGeometry, buildings: Sequence[Building], tree: shapely.STRtree) -> bool:
    """Return whether an area lies on enough of a building to be a passage."""
    return any(
        area.intersection(buildings[index].footprint).area >= MIN_PASSAGE_AREA_M2
        for index in tree.query(area, predicate="intersects").tolist()
    )


def _crossed_buildings(way: BaseGeometry, buildings: Sequence[Building], tree: shapely.STRtree) -> list[int]:
    """Return the indices of the buildings that a way crosses."""
    return [
        index
        for index in sorted(tree.query(way, predicate="intersects").tolist())
        if way.intersection(buildings[index].footprint).length >= MIN_CROSSING_M
    ]


def passage_ids(sources: Sequence[CentrelinesAndGround]) -> frozenset[str]:
    """Return the ids of the ground features that are passages."""
    return frozenset(feature.id for source in sources for feature in source.ground if is_building_passage(feature.tags))


def note_closed_passages(buildings: Sequence[Building], elevation: ElevationRaster | None) -> tuple[str, ...]:
    """Return a note on the buildings whose passages have no room over the ground that the block has.

    Parameters
    ----------
    elevation : raster of the ground, None without one.
    """
    opened = [building for building in buildings if building.passages]
    if not opened:
        return ()
    terrain = build_terrain(buildings, elevation)
    closed = [building.id for building in opened if has_closed_passage(building, terrain)]
    return format_reason_notes({NO_ROOM_REASON: closed})


def _passage_ways(
    streets: CentrelinesAndGround, sources: Sequence[CentrelinesAndGround], crs: CRS
) -> Iterator[_PassageWay]:
    """Yield the passages among the streets, then the other ways and areas that are passages, each geometry once."""
    known: set[bytes] = set()
    pieces = [(index, piece) for index, piece in enumerate(streets.items) if piece.passage is not None]
    lines = project_lines([piece.line for _, piece in pieces], streets.crs, crs)
    ways = [
        _PassageWay(one.id, line, one.passage or {}, index) for (index, one), line in zip(pieces, lines, strict=True)
    ]
    for source in sources:
        features = [
            feature
            for feature in source.ground
            if is_building_passage(feature.tags) and not {"highway", "railway"}.isdisjoint(feature.tags)
        ]
        shapes = project_lines([feature.geometry for feature in features], source.crs, crs)
        for feature, shape in zip(features, shapes, strict=True):
            for part in shapely.get_parts(shape).tolist():
                if ground_surface_class(part, feature.tags) is not None:
                    ways.append(_PassageWay(feature.id, shapely.make_valid(shapely.Polygon(part)), feature.tags))
                elif isinstance(part, LineString) and _make_ways(feature.id, part, feature.tags):
                    ways.append(_PassageWay(feature.id, part, feature.tags))
    for way in ways:
        if not np.isfinite(shapely.get_coordinates(way.shape)).all() or not way.shape.length > 0:
            continue
        key = shapely.normalize(shapely.transform(way.shape, lambda xy: np.round(xy / EQUAL_LINES_M))).wkb
        if key not in known:
            known.add(key)
            yield way


def _make_ways(id: str, line: LineString, tags: Mapping[str, str]) -> list[GroundWay]:
    """Return the drawn ways of a passage; sidewalks and crossings count as footways."""
    return ways_from_tags(id, line, {key: value for key, value in tags.items() if key != "footway"})


def _building_passages(line: LineString, size: _PassageSize, building: Building) -> list[BuildingPassage] | str:
    """Return the passages of a building along a line, or the reason why it stays closed."""
    if building.shell is not None or building.footprint.geom_type != "Polygon":
        return CLOSED_REASON
    corridor = _extend_ends(line, building.footprint, size.width / 2 + MAX_END_GAP_M).buffer(
        size.width / 2, cap_style="flat", join_style="mitre"
    )
    inside = _polygons(shapely.intersection(corridor, building.footprint))
    entered = [part for part in inside if part.intersects(line)]
    if not shapely.length(shapely.intersection(np.array(entered, object), building.footprint.boundary)).any():
        return INNER_REASON
    if max(min(size.height, building.height - MIN_WALL_OVER_PASSAGE_M), building.raised) < MIN_PASSAGE_HEIGHT_M:
        return LOW_REASON
    around = shapely.union_all([part.buffer(OUTLINE_MARGIN_M, join_style="mitre") for part in entered])
    areas = _polygons(shapely.intersection(corridor, around))
    return [BuildingPassage(area, size.height) for area in areas if area.area > MIN_AREA_M2]


def _polygons(geometry: BaseGeometry) -> list[Polygon]:
    return [part for part in shapely.get_parts(geometry).tolist() if part.geom_type == "Polygon"]


def _extend_ends(line: LineString, footprint: BaseGeometry, reach: float) -> LineString:
    """Return a line with ends in or near a footprint extended straight ahead, so that its area reaches the wall."""
    points = shapely.get_coordinates(line)
    for end, before in ((0, 1), (-1, -2)):
        if footprint.distance(shapely.Point(points[end])) < reach:
            ahead = points[end] - points[before]
            tip = points[end] + reach * ahead / np.hypot(*ahead)
            points = np.concatenate([tip[None], points] if end == 0 else [points, tip[None]])
    return shapely.linestrings(points)


def _passage_size(id: str, line: LineString, tags: Mapping[str, str]) -> _PassageSize:
    """Return the width of a passage as of its carriageway, path or tram, and its stated or assumed height."""
    ways = _make_ways(id, line, tags) or ways_from_tags(id, line, {**tags, "highway": ""})
    width = min(max(ways[0].width, TRAM_WIDTH_M if ways[0].kind == "tram" else WIDTH_RANGE_M[0]), WIDTH_RANGE_M[1])
    return _PassageSize(round(width, 2), _stated_height(tags) or DEFAULT_PASSAGE_HEIGHT_M)


def _stated_height(tags: Mapping[str, str]) -> float | None:
    for key in ("maxheight:physical", "maxheight"):
        height = parse_length(tags.get(key, ""))
        if height is not None and HEIGHT_RANGE_M[0] <= height <= HEIGHT_RANGE_M[1]:
            return round(height, 2)
    return None


def _opening_note(tags: Mapping[str, str]) -> str:
    if _stated_height(tags) is not None:
        return OPENED_REASON
    stated = tags.get("maxheight", "").strip().lower()
    return UNREAD_HEIGHT_REASON if stated and stated not in UNKNOWN_HEIGHTS else ASSUMED_HEIGHT_REASON
