"""Passages of streets through buildings: opened in extruded buildings, closed in others.

Tag meanings are those of the OSM wiki ("Tag:tunnel=building_passage").
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely

from catalogs.block.ground import ways_from_tags
from catalogs.block.streets import project_lines
from catalogs.features import Centreline, CentrelinesAndGround
from catalogs.readers.vectors.lengths import parse_length
from facade_core.core.types import MIN_PASSAGE_HEIGHT_M, MIN_WALL_OVER_PASSAGE_M, Building, BuildingPassage

if TYPE_CHECKING:
    from pyproj import CRS
    from shapely import LineString
    from shapely.geometry.base import BaseGeometry

DEFAULT_PASSAGE_HEIGHT_M = 3.5
HEIGHT_RANGE_M = (1.8, 12.0)  # m; other values of `maxheight` are errors
WIDTH_RANGE_M = (2.0, 15.0)  # m
# Values of `maxheight` without a number.
UNKNOWN_HEIGHTS = frozenset(("default", "below_default", "none", "unsigned", "no_sign", "no_indications", "unknown"))
# Metres of a centreline in a building from which it passes through; less touches a corner.
MIN_CROSSING_M = 1.0
# Metres by which a mapped end of a passage may be short of the wall, besides half its width.
MAX_END_GAP_M = 2.0
# Metres that an area reaches beyond its building, since outlines are simplified later.
OUTLINE_MARGIN_M = 0.5
MIN_AREA_M2 = 0.1

CLOSED_REASON = "passages through buildings closed, without viewpoints"
LOW_REASON = "passages through buildings too low for them closed, without viewpoints"
INNER_REASON = "passages that do not reach the walls of their buildings closed, without viewpoints"
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


def open_passages(buildings: Sequence[Building], streets: CentrelinesAndGround, crs: CRS) -> OpenedPassages:
    """Open the passages of streets through extruded buildings, and drop the other passages from the streets.

    A passage through several buildings is opened in all of them, or in none where one is a model or too low. A passage
    that enters no building stays a street.

    Parameters
    ----------
    streets : centrelines; a source without a frame is in the block's.
    crs : metric frame of the block.
    """
    indices = [index for index, piece in enumerate(streets.items) if piece.passage is not None]
    reasons: dict[str, list[str]] = defaultdict(list)
    lines = project_lines([streets.items[index].line for index in indices], streets.crs, crs)
    by_size: dict[_PassageSize, list[tuple[int, LineString]]] = defaultdict(list)
    for index, line in zip(indices, lines, strict=True):
        if np.isfinite(shapely.get_coordinates(line)).all() and line.length > 0:
            by_size[_passage_size(streets.items[index], line)].append((index, line))
    tree = shapely.STRtree([building.footprint for building in buildings])
    corridors: dict[int, list[BuildingPassage]] = defaultdict(list)
    closed: set[int] = set()
    for size, pieces in by_size.items():
        for whole in shapely.get_parts(shapely.line_merge(shapely.multilinestrings([line for _, line in pieces]))):
            members = [index for index, line in pieces if shapely.covers(whole, line)]
            ids = [streets.items[index].id for index in members]
            crossed = [
                index
                for index in sorted(tree.query(whole, predicate="intersects").tolist())
                if whole.intersection(buildings[index].footprint).length >= MIN_CROSSING_M
            ]
            if not crossed:
                continue
            found = {index: _building_passages(whole, size, buildings[index]) for index in crossed}
            if reason := next((one for one in found.values() if isinstance(one, str)), None):
                reasons[reason] += ids
                closed.update(members)
                continue
            for index, own in found.items():
                corridors[index] += [passage for passage in own if isinstance(passage, BuildingPassage)]
            for index in members:
                reasons[_opening_note(streets.items[index])].append(streets.items[index].id)
    opened = tuple(
        replace(building, passages=tuple(corridors[index])) if index in corridors else building
        for index, building in enumerate(buildings)
    )
    left = tuple(piece for index, piece in enumerate(streets.items) if index not in closed)
    return OpenedPassages(opened, replace(streets, items=left), reasons)


def passage_ids(streets: CentrelinesAndGround) -> frozenset[str]:
    """Return the ids of the features that are passages."""
    ids = {piece.id for piece in streets.items if piece.passage is not None}
    return frozenset(ids | {id.rpartition("-")[0] for id in ids})


def _building_passages(line: LineString, size: _PassageSize, building: Building) -> list[BuildingPassage] | str:
    """Return the passages of a building along a line, or the reason why it stays closed."""
    if building.shell is not None or building.footprint.geom_type != "Polygon":
        return CLOSED_REASON
    corridor = _extend_ends(line, building.footprint, size.width / 2 + MAX_END_GAP_M).buffer(
        size.width / 2, cap_style="flat", join_style="mitre"
    )
    inside = shapely.get_parts(shapely.intersection(corridor, building.footprint))
    entered = [part for part in inside.tolist() if part.geom_type == "Polygon" and part.intersects(line)]
    if not any(part.intersection(building.footprint.boundary).length > 0 for part in entered):
        return INNER_REASON
    if max(min(size.height, building.height - MIN_WALL_OVER_PASSAGE_M), building.raised) < MIN_PASSAGE_HEIGHT_M:
        return LOW_REASON
    around = shapely.union_all([part.buffer(OUTLINE_MARGIN_M, join_style="mitre") for part in entered])
    areas = shapely.get_parts(shapely.intersection(corridor, around)).tolist()
    return [
        BuildingPassage(area, size.height) for area in areas if area.geom_type == "Polygon" and area.area > MIN_AREA_M2
    ]


def _extend_ends(line: LineString, footprint: BaseGeometry, reach: float) -> LineString:
    """Return a line with ends in or near a footprint extended straight ahead, so that its area reaches the wall."""
    points = shapely.get_coordinates(line)
    for end, before in ((0, 1), (-1, -2)):
        if footprint.distance(shapely.Point(points[end])) < reach:
            ahead = points[end] - points[before]
            tip = points[end] + reach * ahead / np.hypot(*ahead)
            points = np.concatenate([tip[None], points] if end == 0 else [points, tip[None]])
    return shapely.linestrings(points)


def _passage_size(piece: Centreline, line: LineString) -> _PassageSize:
    """Return the width of a passage as of its carriageway or path, and its stated or assumed height."""
    tags = dict(piece.passage or {})
    ways = ways_from_tags(piece.id, line, tags) or ways_from_tags(piece.id, line, {**tags, "highway": ""})
    width = min(max(ways[0].width, WIDTH_RANGE_M[0]), WIDTH_RANGE_M[1])
    return _PassageSize(round(width, 2), _stated_height(tags) or DEFAULT_PASSAGE_HEIGHT_M)


def _stated_height(tags: Mapping[str, str]) -> float | None:
    for key in ("maxheight:physical", "maxheight"):
        height = parse_length(tags.get(key, ""))
        if height is not None and HEIGHT_RANGE_M[0] <= height <= HEIGHT_RANGE_M[1]:
            return round(height, 2)
    return None


def _opening_note(piece: Centreline) -> str:
    tags = piece.passage or {}
    if _stated_height(tags) is not None:
        return OPENED_REASON
    stated = tags.get("maxheight", "").strip().lower()
    return UNREAD_HEIGHT_REASON if stated and stated not in UNKNOWN_HEIGHTS else ASSUMED_HEIGHT_REASON
