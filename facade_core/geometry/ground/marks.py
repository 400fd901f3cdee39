"""What is marked on the ground and let into it: lanes, crossings, parking, rails, covers, mended places, the edges of steps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from hashlib import blake2b

import numpy as np
import shapely
from shapely import LineString

from facade_core.core.types import Way

# Kinds of marks, what lies lower first.
PATCH, JOINT, IRON, STEEL, PAINT = range(5)
# Metres: a lane's dash, and from one to the next; half a line's width; from a crossing's bar to the next and half its width and
# length; a parking place; from a step to the next.
DASH_M, DASHES_M, LINE_M = 3.0, 9.0, 0.06
BARS_M, BAR_M = 1.0, (0.25, 1.6)
PLACE_M, STEP_M = 6.0, 0.35
# A line along the kerb: so far from it; on roads of this rank, or without a pavement of the second.
EDGE_M, EDGED, BARE_EDGED = 0.55, 6, 4
# A line where cars stop: half its width, how far before a crossing's middle or the other carriageway, and from a kerb; on roads
# with lanes that are marked or of this rank, and where a lesser road ends in such a share of cases.
STOP_M, BEFORE_M, OFF_M, OF_RANK, ENDING = 0.15, 2.9, 0.4, 5, 0.4
# Markings keep this far from where roads meet, and from a crossing.
CLEAR_M = 10.0
# From one cover or mended place to the next, on average.
COVERS_M, PATCHES_M, GULLIES_M = 38.0, 26.0, 24.0

_Row = tuple[float, float, float, float, float, int, int]


def marks(ways: Sequence[Way], carriageway: shapely.Geometry, junctions: shapely.Geometry) -> np.ndarray:
    """All marks (m, 7): x0, y0, x1, y1, half a width, kind, whether its ends are round.

    What is dashed counts from the world's origin, so that a line that is cut has the same dashes.
    """
    roads = [way for way in ways if way.kind == "road"]
    crossings = [way for way in ways if way.kind == "crossing"]
    clear = [junctions.buffer(CLEAR_M)] if not junctions.is_empty else []
    clear += [way.line.buffer(2.5 * BAR_M[1], cap_style="flat") for way in crossings]
    kept_clear = shapely.union_all(clear) if clear else shapely.Point()
    # of two crossings drawn across each other's place one is enough
    kept: list[LineString] = []
    rows: list[_Row] = []
    for way in roads:
        rows += _covers(way, carriageway, kept_clear)
        rows += _lanes(way, kept_clear)
        rows += _parking(way, kept_clear)
        rows += _edges(way, kept_clear)
        rows += _stops(way, roads, crossings)
    for way in crossings:
        middle = way.line.intersection(carriageway).centroid
        if not middle.is_empty and all(middle.distance(other) > 4.0 for other in kept):
            kept.append(way.line)
            rows += _bars(way.line, carriageway)
    for way in ways:
        if way.kind == "tram":
            for side in (-0.5, 0.5):
                rail = shapely.offset_curve(way.line, side * way.width)
                rows += [(*piece, 0.075, JOINT, 0) for piece in _pieces(rail)]
                rows += [(*piece, 0.035, STEEL, 0) for piece in _pieces(rail)]
        elif way.kind == "steps":
            rows += _steps(way)
    table = np.array(rows, np.float64).reshape(-1, 7)
    return table[np.argsort(table[:, 5], kind="stable")]


def _pieces(line: shapely.Geometry) -> Iterator[tuple[float, float, float, float]]:
    """The straight pieces x0, y0, x1, y1 of lines."""
    for part in shapely.get_parts(line):
        points = shapely.get_coordinates(part).tolist()
        for (x0, y0), (x1, y1) in zip(points[:-1], points[1:], strict=True):
            if x0 != x1 or y0 != y1:
                yield x0, y0, x1, y1


def _dashed(
    line: shapely.Geometry, length: float, period: float
) -> Iterator[tuple[float, float, float, float, float, float]]:
    """Dashes x0, y0, x1, y1 of lines with their direction, counted from the world's origin along each straight piece."""
    for x0, y0, x1, y1 in _pieces(line):
        whole = float(np.hypot(x1 - x0, y1 - y0))
        east, north = (x1 - x0) / whole, (y1 - y0) / whole
        if (east, north) < (0.0, 0.0):  # the same dashes whichever way it runs
            x0, y0, x1, y1, east, north = x1, y1, x0, y0, -east, -north
        start = x0 * east + y0 * north
        for number in range(int(np.floor((start - length) / period)), int(np.ceil((start + whole) / period))):
            low, high = max(number * period - start, 0.0), min(number * period + length - start, whole)
            if high > low:
                yield x0 + low * east, y0 + low * north, x0 + high * east, y0 + high * north, east, north


def _lanes(way: Way, clear: shapely.Geometry) -> list[_Row]:
    """Dashes between the lanes of a road that states them, where it is asphalt."""
    rows: list[_Row] = []
    if way.surface != "asphalt" or way.lanes < 2:
        return rows
    left, right = way.parking
    driven = way.width - left - right
    first = -way.width / 2 + right
    for number in range(1, way.lanes):
        offset = first + driven * number / way.lanes
        # GEOS fails by what rounding leaves of nothing
        line = shapely.offset_curve(way.line, offset if abs(offset) > 1e-9 else 0.0, join_style="mitre")
        middle = not way.oneway and 2 * number == way.lanes and way.lanes > 2
        line = shapely.difference(line, clear)
        pieces = _pieces(line) if middle else (dash[:4] for dash in _dashed(line, DASH_M, DASHES_M))
        rows += [(*piece, LINE_M, PAINT, 0) for piece in pieces]
    return rows


def _parking(way: Way, clear: shapely.Geometry) -> list[_Row]:
    """Lines between places along the kerb, and a line along them on asphalt."""
    rows: list[_Row] = []
    for side, wide in zip((1.0, -1.0), way.parking, strict=True):
        if wide <= 0:
            continue
        edge = side * (way.width / 2 - wide)
        line = shapely.difference(shapely.offset_curve(way.line, edge, join_style="mitre"), clear)
        for x, y, _, _, east, north in _dashed(line, 0.12, PLACE_M):
            # to the kerb: left of the line's own direction, which _dashed may have turned
            outward = np.array([-north, east])
            middle = shapely.Point(x + outward[0], y + outward[1])
            if way.line.distance(middle) < abs(edge):
                outward = -outward
            end = np.array([x, y]) + outward * (wide - 0.4)
            rows.append((x, y, float(end[0]), float(end[1]), 0.05, PAINT, 0))
    return rows


def _edges(way: Way, clear: shapely.Geometry) -> list[_Row]:
    """Lines along the kerbs of a road with marked lanes that is large, or has no pavement there; none beside parked cars."""
    rows: list[_Row] = []
    if way.surface != "asphalt" or way.lanes < 2:
        return rows
    for side, parked, pavement in zip((1.0, -1.0), way.parking, way.pavement, strict=True):
        if parked == 0 and way.rank >= (EDGED if pavement > 0 else BARE_EDGED):
            line = shapely.offset_curve(way.line, side * (way.width / 2 - EDGE_M), join_style="mitre")
            rows += [(*piece, LINE_M, PAINT, 0) for piece in _pieces(shapely.difference(line, clear))]
    return rows


def _stops(way: Way, roads: Sequence[Way], crossings: Sequence[Way]) -> list[_Row]:
    """Lines across the half of a road on which cars come, before its crossings and where it ends in a road of higher rank.

    Cars are taken to keep right.
    """
    rows: list[_Row] = []
    if way.surface != "asphalt" or way.width < 4.0:
        return rows
    crossed: list[float] = []
    for crossing in crossings:
        place = shapely.intersection(way.line, crossing.line).centroid
        if not place.is_empty and all(abs(way.line.project(place) - other) > BEFORE_M for other in crossed):
            crossed.append(way.line.project(place))
    if way.lanes >= 2 or way.rank >= OF_RANK:
        for along in crossed:
            rows += _stop(way, along - BEFORE_M, 1.0)
            rows += _stop(way, along + BEFORE_M, -1.0)
    for end, at, forward in ((way.line.coords[0], 0.0, -1.0), (way.line.coords[-1], way.line.length, 1.0)):
        place = shapely.Point(end)
        above = [other for other in roads if other.rank > way.rank and other.line.distance(place) < 0.05]
        first, second, _ = _chances(*end)
        marked = way.lanes >= 2 or (way.rank >= 3 and first + second < 2 * ENDING)
        if above and marked and not any(abs(along - at) < 3 * BEFORE_M for along in crossed):
            away = max(other.width for other in above) / 2 + BEFORE_M / 2
            rows += _stop(way, at - forward * away, forward)
    return rows


def _stop(way: Way, at: float, forward: float) -> list[_Row]:
    """One such line at a distance along a road, for cars that go along it (1) or against it (-1)."""
    if not 0.5 < at < way.line.length - 0.5 or (way.oneway and forward < 0):
        return []
    before, after = shapely.get_coordinates(shapely.line_interpolate_point(way.line, [at - 0.5, at + 0.5]))
    run = forward * (after - before) / max(float(np.hypot(*(after - before))), 1e-9)
    right = np.array([run[1], -run[0]])
    left_m, right_m = (way.width / 2 - parked - OFF_M for parked in way.parking[:: 1 if forward > 0 else -1])
    middle = (before + after) / 2
    start = middle + right * (-left_m if way.oneway else LINE_M)
    return [(*start.tolist(), *(middle + right * right_m).tolist(), STOP_M, PAINT, 0)]


def _bars(line: LineString, carriageway: shapely.Geometry) -> list[_Row]:
    """The bars of a crossing: side by side along the line on the carriageway, along the road."""
    rows: list[_Row] = []
    on_road = shapely.intersection(line, carriageway.buffer(-0.35))
    for part in shapely.get_parts(on_road):
        if part.geom_type != "LineString" or part.length < 2.0:
            continue
        ends = shapely.get_coordinates(part)[[0, -1]]
        across = (ends[1] - ends[0]) / max(float(np.hypot(*(ends[1] - ends[0]))), 1e-9)
        along = np.array([-across[1], across[0]]) * BAR_M[1]
        length = float(np.hypot(*(ends[1] - ends[0])))
        count = int(length // BARS_M)
        for number in range(count):
            middle = ends[0] + across * (length / 2 + (number - (count - 1) / 2) * BARS_M)
            rows.append((*(middle - along).tolist(), *(middle + along).tolist(), BAR_M[0], PAINT, 0))
    return rows


def _steps(way: Way) -> list[_Row]:
    rows: list[_Row] = []
    for x, y, _, _, east, north in _dashed(way.line, 0.05, STEP_M):
        reach = way.width / 2
        rows.append((x - reach * -north, y - reach * east, x + reach * -north, y + reach * east, 0.02, JOINT, 0))
    return rows


def _covers(way: Way, carriageway: shapely.Geometry, clear: shapely.Geometry) -> list[_Row]:
    """Manholes, gullies at the kerbs and mended places, by chance of the place."""
    rows: list[_Row] = []
    half = way.width / 2
    if half < 1.6:
        return rows
    for x0, y0, _, _, east, north in _dashed(way.line, 0.02, GULLIES_M):
        for side in (-1.0, 1.0):
            x, y = x0 - side * north * (half - 0.27), y0 + side * east * (half - 0.27)
            if clear.distance(shapely.Point(x, y)) != 0:
                rows.append((x - 0.25 * east, y - 0.25 * north, x + 0.25 * east, y + 0.25 * north, 0.18, IRON, 0))
    for x0, y0, _, _, east, north in _dashed(way.line, 0.02, COVERS_M):
        first, second, third = _chances(x0, y0)
        x, y = x0 + east * 30 * (first - 0.5), y0 + north * 30 * (first - 0.5)
        aside = (0.5 if second < 0.6 else -0.45) * half
        x, y = x - north * aside, y + east * aside
        if carriageway.contains(shapely.Point(x, y)):
            rows.append((x, y, x + 0.001 * east, y + 0.001 * north, 0.31 if third < 0.8 else 0.2, IRON, 1))
    if way.surface != "asphalt":
        return rows
    for x0, y0, _, _, east, north in _dashed(way.line, 0.02, PATCHES_M):
        first, second, third = _chances(x0 + 7, y0)
        if third < 0.5:
            continue
        aside, long, wide = (first - 0.5) * (way.width - 2.4), 1.0 + 5 * second, 0.35 + 0.6 * first * second
        x, y = x0 - north * aside, y0 + east * aside
        rows.append((x, y, x + long * east, y + long * north, wide, PATCH, 0))
    return rows


def _chances(x: float, y: float) -> tuple[float, float, float]:
    """Three numbers in 0..1 by chance of a place, to the decimetre."""
    digest = blake2b(f"{round(x, 1) + 0.0} {round(y, 1) + 0.0}".encode(), digest_size=12).digest()
    first, second, third = (int.from_bytes(digest[k : k + 4]) / 2**32 for k in (0, 4, 8))
    return first, second, third
