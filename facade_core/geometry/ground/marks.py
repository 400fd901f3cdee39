"""Marks on the ground: lanes, crossings, parking, rails, covers, patches and the edges of steps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from hashlib import blake2b

import numpy as np
import shapely
from shapely import LineString

from facade_core.core.arrays import Float64Array
from facade_core.core.types import GroundWay
from facade_core.geometry.ground.settings import MARKS


class GroundMarkKind(IntEnum):
    """Kind of a ground mark, in the order in which marks cover each other, lowest first."""

    PATCH = 0
    JOINT = 1
    IRON = 2
    STEEL = 3
    PAINT = 4


_MarkRow = tuple[float, float, float, float, float, int, int]


def ground_marks(ways: Sequence[GroundWay], carriageway: shapely.Geometry, junctions: shapely.Geometry) -> Float64Array:
    """Compute all marks of ways.

    Dashes count from the world's origin, so that a line that is cut keeps its dashes.

    Parameters
    ----------
    ways : mapped ways.
    carriageway : union of the carriageways.
    junctions : points at which roads meet.

    Returns
    -------
    (m, 7) x0, y0, x1, y1, half width in metres, `GroundMarkKind`, 1 where the ends are round.
    """
    roads = [way for way in ways if way.kind == "road"]
    crossings = [way for way in ways if way.kind == "crossing"]
    kept_clear = clear_of_marks(ways, junctions)
    # crossings that are mapped twice are drawn once
    kept: list[LineString] = []
    rows: list[_MarkRow] = []
    for way in roads:
        rows += _covers_and_patches(way, carriageway, kept_clear)
        rows += _lane_lines(way, kept_clear)
        rows += _parking_lines(way, kept_clear)
        rows += _edge_lines(way, kept_clear)
        rows += _stop_lines(way, roads, crossings)
    for way in crossings:
        middle = way.line.intersection(carriageway).centroid
        if not middle.is_empty and all(middle.distance(other) > 4.0 for other in kept):
            kept.append(way.line)
            rows += _crossing_bars(way.line, carriageway)
    for way in ways:
        if way.kind == "tram":
            for side in (-0.5, 0.5):
                rail = shapely.offset_curve(way.line, side * way.width)
                rows += [(*piece, 0.075, GroundMarkKind.JOINT, 0) for piece in _straight_pieces(rail)]
                rows += [(*piece, 0.035, GroundMarkKind.STEEL, 0) for piece in _straight_pieces(rail)]
        elif way.kind == "steps":
            rows += _step_edges(way)
    table = np.array(rows, np.float64).reshape(-1, 7)
    return table[np.argsort(table[:, 5], kind="stable")]


def clear_of_marks(ways: Sequence[GroundWay], junctions: shapely.Geometry) -> shapely.Geometry:
    """Return the ground at junctions and crossings, which has neither marks of lanes nor parking places."""
    clear = [junctions.buffer(MARKS.junction_clearance_m)] if not junctions.is_empty else []
    reach = 2.5 * MARKS.bar_half_size_m[1]
    clear += [way.line.buffer(reach, cap_style="flat") for way in ways if way.kind == "crossing"]
    return shapely.union_all(clear) if clear else shapely.Point()


def _straight_pieces(line: shapely.Geometry) -> Iterator[tuple[float, float, float, float]]:
    """Yield the straight pieces x0, y0, x1, y1 of lines."""
    for part in shapely.get_parts(line):
        points = shapely.get_coordinates(part).tolist()
        for (x0, y0), (x1, y1) in zip(points[:-1], points[1:], strict=True):
            if x0 != x1 or y0 != y1:
                yield x0, y0, x1, y1


def _dashes(
    line: shapely.Geometry, length: float, period: float
) -> Iterator[tuple[float, float, float, float, float, float]]:
    """Yield dashes x0, y0, x1, y1 and their direction, counted from the world's origin along each straight piece."""
    for x0, y0, x1, y1 in _straight_pieces(line):
        whole = float(np.hypot(x1 - x0, y1 - y0))
        east, north = (x1 - x0) / whole, (y1 - y0) / whole
        if (east, north) < (0.0, 0.0):  # the same dashes in both directions of the line
            x0, y0, x1, y1, east, north = x1, y1, x0, y0, -east, -north
        start = x0 * east + y0 * north
        for number in range(int(np.floor((start - length) / period)), int(np.ceil((start + whole) / period))):
            low, high = max(number * period - start, 0.0), min(number * period + length - start, whole)
            if high > low:
                yield x0 + low * east, y0 + low * north, x0 + high * east, y0 + high * north, east, north


def _lane_lines(way: GroundWay, clear: shapely.Geometry) -> list[_MarkRow]:
    """Return dashes between the marked lanes of an asphalt road."""
    rows: list[_MarkRow] = []
    if way.surface != "asphalt" or way.lanes < 2:
        return rows
    left, right = way.parking
    driven = way.width - left - right
    first = -way.width / 2 + right
    for number in range(1, way.lanes):
        offset = first + driven * number / way.lanes
        # GEOS fails for an offset that differs from 0 by rounding alone
        line = shapely.offset_curve(way.line, offset if abs(offset) > 1e-9 else 0.0, join_style="mitre")
        middle = not way.oneway and 2 * number == way.lanes and way.lanes > 2
        line = shapely.difference(line, clear)
        pieces = (
            _straight_pieces(line)
            if middle
            else (dash[:4] for dash in _dashes(line, MARKS.dash_m, MARKS.dash_period_m))
        )
        rows += [(*piece, MARKS.line_half_width_m, GroundMarkKind.PAINT, 0) for piece in pieces]
    return rows


@dataclass(frozen=True, slots=True)
class ParkingPlace:
    """Place along a kerb.

    Attributes
    ----------
    corner : (2,) its first corner on the side of the lane, metres.
    along, outward : (2,) unit vectors from there along the road and to the kerb.
    depth : metres to the kerb.
    is_whole : the road goes straight on to the next place.
    """

    corner: Float64Array
    along: Float64Array
    outward: Float64Array
    depth: float
    is_whole: bool

    @property
    def middle(self) -> Float64Array:
        """Return the middle (2,)."""
        middle: Float64Array = self.corner + (self.along * MARKS.parking_place_m + self.outward * self.depth) / 2
        return middle


def parking_places(way: GroundWay, clear: shapely.Geometry) -> Iterator[ParkingPlace]:
    """Yield the parking places of a road outside of `clear`."""
    for side, wide in zip((1.0, -1.0), way.parking, strict=True):
        if wide <= 0:
            continue
        edge = side * (way.width / 2 - wide)
        line = shapely.difference(shapely.offset_curve(way.line, edge, join_style="mitre"), clear)
        for x, y, _, _, east, north in _dashes(line, 0.12, MARKS.parking_place_m):
            # to the kerb: left of the line's own direction, which _dashes may have turned
            outward = np.array([-north, east])
            middle = shapely.Point(x + outward[0], y + outward[1])
            if way.line.distance(middle) < abs(edge):
                outward = -outward
            corner, along = np.array([x, y]), np.array([east, north])
            is_whole = bool(line.distance(shapely.Point(corner + along * MARKS.parking_place_m)) < 0.1)
            yield ParkingPlace(corner, along, outward, wide, is_whole)


def _parking_lines(way: GroundWay, clear: shapely.Geometry) -> Iterator[_MarkRow]:
    """Yield the lines between parking places."""
    for place in parking_places(way, clear):
        (x0, y0), (x1, y1) = place.corner, place.corner + place.outward * (place.depth - 0.4)
        yield float(x0), float(y0), float(x1), float(y1), 0.05, GroundMarkKind.PAINT, 0


def _edge_lines(way: GroundWay, clear: shapely.Geometry) -> list[_MarkRow]:
    """Return lines along the kerbs of a road with marked lanes that is large or has no pavement; none along parked cars."""
    rows: list[_MarkRow] = []
    if way.surface != "asphalt" or way.lanes < 2:
        return rows
    for side, parked, pavement in zip((1.0, -1.0), way.parking, way.pavement, strict=True):
        if parked == 0 and way.rank >= (MARKS.min_edged_rank if pavement > 0 else MARKS.min_bare_edged_rank):
            line = shapely.offset_curve(way.line, side * (way.width / 2 - MARKS.edge_line_offset_m), join_style="mitre")
            rows += [
                (*piece, MARKS.line_half_width_m, GroundMarkKind.PAINT, 0)
                for piece in _straight_pieces(shapely.difference(line, clear))
            ]
    return rows


def _stop_lines(way: GroundWay, roads: Sequence[GroundWay], crossings: Sequence[GroundWay]) -> list[_MarkRow]:
    """Return stop lines before crossings, and where a road ends at one of higher rank.

    Traffic is taken to keep right.
    """
    rows: list[_MarkRow] = []
    if way.surface != "asphalt" or way.width < 4.0:
        return rows
    crossed: list[float] = []
    for crossing in crossings:
        place = shapely.intersection(way.line, crossing.line).centroid
        if not place.is_empty and all(
            abs(way.line.project(place) - other) > MARKS.stop_distance_m for other in crossed
        ):
            crossed.append(way.line.project(place))
    if way.lanes >= 2 or way.rank >= MARKS.min_stop_rank:
        for along in crossed:
            rows += _stop_line(way, along - MARKS.stop_distance_m, 1.0)
            rows += _stop_line(way, along + MARKS.stop_distance_m, -1.0)
    for end, at, forward in ((way.line.coords[0], 0.0, -1.0), (way.line.coords[-1], way.line.length, 1.0)):
        place = shapely.Point(end)
        above = [other for other in roads if other.rank > way.rank and other.line.distance(place) < 0.05]
        first, second, _ = _hash_place(*end)
        marked = way.lanes >= 2 or (way.rank >= 3 and first + second < 2 * MARKS.stop_at_end_share)
        if above and marked and not any(abs(along - at) < 3 * MARKS.stop_distance_m for along in crossed):
            away = max(other.width for other in above) / 2 + MARKS.stop_distance_m / 2
            rows += _stop_line(way, at - forward * away, forward)
    return rows


def _stop_line(way: GroundWay, at: float, forward: float) -> list[_MarkRow]:
    """Return the stop line at a distance along a road, for traffic along it (1) or against it (-1)."""
    if not 0.5 < at < way.line.length - 0.5 or (way.oneway and forward < 0):
        return []
    before, after = shapely.get_coordinates(shapely.line_interpolate_point(way.line, [at - 0.5, at + 0.5]))
    run = forward * (after - before) / max(float(np.hypot(*(after - before))), 1e-9)
    right = np.array([run[1], -run[0]])
    left_m, right_m = (
        way.width / 2 - parked - MARKS.stop_kerb_gap_m for parked in way.parking[:: 1 if forward > 0 else -1]
    )
    middle = (before + after) / 2
    start = middle + right * (-left_m if way.oneway else MARKS.line_half_width_m)
    return [
        (
            *start.tolist(),
            *(middle + right * right_m).tolist(),
            MARKS.stop_line_half_width_m,
            GroundMarkKind.PAINT,
            0,
        )
    ]


def _crossing_bars(line: LineString, carriageway: shapely.Geometry) -> list[_MarkRow]:
    """Return the bars of a crossing, parallel to the road."""
    rows: list[_MarkRow] = []
    on_road = shapely.intersection(line, carriageway.buffer(-0.35))
    for part in shapely.get_parts(on_road):
        if part.geom_type != "LineString" or part.length < 2.0:
            continue
        ends = shapely.get_coordinates(part)[[0, -1]]
        across = (ends[1] - ends[0]) / max(float(np.hypot(*(ends[1] - ends[0]))), 1e-9)
        along = np.array([-across[1], across[0]]) * MARKS.bar_half_size_m[1]
        length = float(np.hypot(*(ends[1] - ends[0])))
        count = int(length // MARKS.bar_period_m)
        for number in range(count):
            middle = ends[0] + across * (length / 2 + (number - (count - 1) / 2) * MARKS.bar_period_m)
            rows.append(
                (
                    *(middle - along).tolist(),
                    *(middle + along).tolist(),
                    MARKS.bar_half_size_m[0],
                    GroundMarkKind.PAINT,
                    0,
                )
            )
    return rows


def _step_edges(way: GroundWay) -> list[_MarkRow]:
    rows: list[_MarkRow] = []
    for x, y, _, _, east, north in _dashes(way.line, 0.05, MARKS.stair_period_m):
        reach = way.width / 2
        rows.append(
            (x - reach * -north, y - reach * east, x + reach * -north, y + reach * east, 0.02, GroundMarkKind.JOINT, 0)
        )
    return rows


def _covers_and_patches(way: GroundWay, carriageway: shapely.Geometry, clear: shapely.Geometry) -> list[_MarkRow]:
    """Return manholes, gullies at the kerbs and patches, random by place."""
    rows: list[_MarkRow] = []
    half = way.width / 2
    if half < 1.6:
        return rows
    for x0, y0, _, _, east, north in _dashes(way.line, 0.02, MARKS.gully_spacing_m):
        for side in (-1.0, 1.0):
            x, y = x0 - side * north * (half - 0.27), y0 + side * east * (half - 0.27)
            if clear.distance(shapely.Point(x, y)) != 0:
                rows.append(
                    (x - 0.25 * east, y - 0.25 * north, x + 0.25 * east, y + 0.25 * north, 0.18, GroundMarkKind.IRON, 0)
                )
    for x0, y0, _, _, east, north in _dashes(way.line, 0.02, MARKS.cover_spacing_m):
        first, second, third = _hash_place(x0, y0)
        x, y = x0 + east * 30 * (first - 0.5), y0 + north * 30 * (first - 0.5)
        aside = (0.5 if second < 0.6 else -0.45) * half
        x, y = x - north * aside, y + east * aside
        if carriageway.contains(shapely.Point(x, y)):
            rows.append(
                (x, y, x + 0.001 * east, y + 0.001 * north, 0.31 if third < 0.8 else 0.2, GroundMarkKind.IRON, 1)
            )
    if way.surface != "asphalt":
        return rows
    for x0, y0, _, _, east, north in _dashes(way.line, 0.02, MARKS.patch_spacing_m):
        first, second, third = _hash_place(x0 + 7, y0)
        if third < 0.5:
            continue
        aside, long, wide = (first - 0.5) * (way.width - 2.4), 1.0 + 5 * second, 0.35 + 0.6 * first * second
        x, y = x0 - north * aside, y0 + east * aside
        rows.append((x, y, x + long * east, y + long * north, wide, GroundMarkKind.PATCH, 0))
    return rows


def _hash_place(x: float, y: float) -> tuple[float, float, float]:
    """Return three pseudo-random numbers in [0, 1) of a place, to the decimetre."""
    digest = blake2b(f"{round(x, 1) + 0.0} {round(y, 1) + 0.0}".encode(), digest_size=12).digest()
    first, second, third = (int.from_bytes(digest[k : k + 4]) / 2**32 for k in (0, 4, 8))
    return first, second, third
