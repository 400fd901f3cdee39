"""The ground as shapes, drawn a square of the world grid at a time out of what lies near it: what kernels look up."""

from __future__ import annotations

import json
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import blake2b
from typing import NamedTuple

import numpy as np
import shapely

from facade_core.core.types import SURFACES, Area, Ground, Way
from facade_core.geometry.charts import ChartKind, Charts
from facade_core.geometry.ground.layers import carriageways, layers_of
from facade_core.geometry.ground.marks import marks

# Side of a square, as ground is cut into charts; what lies so far around it is drawn with it; metres.
SQUARE_M, AROUND_M = 32.0, 32.0
# Side of a cell that lists what lies near it, and how near: an edge is soft over twice that at most.
CELL_M, REACH_M = 1.0, 0.8
CELLS = round(SQUARE_M / CELL_M)
# More than there are layers.
ROAD_KEYS = 256
# Version of the text by which a way enters digests; a new field of Way, or another order, raises it.
WAY_FORMAT = 1
# Squares that are kept.
KEPT = 512


class Drawn(NamedTuple):
    """Some squares, as kernels read them.

    square (charts,): that of each chart, -1 where it is not among them;
    low (t, 2): their corners;
    of a cell the rows of what it lists, one cell after the other, start ... (t * CELLS^2 + 1,):
    layers: layer (e,), inside (e,) whether the cell's middle is, first_edge (e + 1,), edges (k, 5), which have
    what is inside on their left;
    frames (f, 9): straight pieces of roads, half their width, surface, rank, width of lanes;
    marks (m, 8): straight pieces, half their width, which, whether round.
    A straight piece begins with x, y, its direction east and north, its length.
    """

    square: np.ndarray
    low: np.ndarray
    start_layer: np.ndarray
    layer: np.ndarray
    inside: np.ndarray
    first_edge: np.ndarray
    edges: np.ndarray
    start_frame: np.ndarray
    frames: np.ndarray
    start_mark: np.ndarray
    marks: np.ndarray


def serialise_way(way: Way) -> str:
    """Serialise what a way looks like, without its id and line, as JSON for digests; the list starts with its version."""
    return json.dumps(
        [
            WAY_FORMAT,
            way.kind,
            float(way.width),
            way.surface,
            bool(way.assumed),
            int(way.lanes),
            bool(way.oneway),
            [float(metres) for metres in way.pavement],
            [float(metres) for metres in way.parking],
            int(way.rank),
        ]
    )


@dataclass(frozen=True)
class Piece:
    """What a square is drawn of: ways and areas as far as they lie within AROUND_M of it."""

    low: tuple[float, float]
    ways: tuple[Way, ...]
    areas: tuple[Area, ...]

    @property
    def digest(self) -> bytes:
        found = blake2b(repr(self.low).encode(), digest_size=16)
        for way in self.ways:
            found.update(shapely.to_wkb(way.line) + serialise_way(way).encode())
        for area in self.areas:
            found.update(shapely.to_wkb(area.outline) + area.surface.encode())
        return found.digest()


class Squares:
    """A block's ground by squares."""

    def __init__(self, ground: Ground, charts: Charts) -> None:
        self._ground = ground
        middle = charts.at_shares(np.arange(len(charts)), np.array([[0.5, 0.5]]))[:, 0, :2]
        self._square = np.floor(middle / SQUARE_M).astype(np.int64)
        self._is_ground = charts.kind == ChartKind.GROUND
        self._digests: dict[tuple[int, ...], bytes] = {}
        self._drawn: OrderedDict[tuple[int, int], tuple[np.ndarray, ...]] = OrderedDict()

    def of(self, charts: Sequence[int] | np.ndarray) -> Drawn:
        """What the kernels need of the ground among some charts."""
        square = np.full(len(self._is_ground), -1, np.int32)
        own = [int(chart) for chart in charts if self._is_ground[chart]]
        squares = sorted({tuple(self._square[chart].tolist()) for chart in own})
        number = {one: index for index, one in enumerate(squares)}
        for chart in own:
            square[chart] = number[tuple(self._square[chart].tolist())]
        return _joined(square, squares, [self._of(one) for one in squares])

    def digest(self, chart: int) -> bytes:
        """Of all that the ground on a chart is drawn of."""
        square = tuple(self._square[chart].tolist())
        if square not in self._digests:
            self._digests[square] = self.piece(square).digest
        return self._digests[square]

    def around(self, chart: int) -> Piece:
        """What the ground on a chart and around it is drawn of."""
        return self.piece(tuple(self._square[chart].tolist()))

    def _of(self, square: tuple[int, int]) -> tuple[np.ndarray, ...]:
        if square not in self._drawn:
            self._drawn[square] = draw(self.piece(square))
            if len(self._drawn) > KEPT:
                self._drawn.popitem(last=False)
        return self._drawn[square]

    def piece(self, square: tuple[int, ...]) -> Piece:
        low = np.array(square) * SQUARE_M
        around = (*(low - AROUND_M), *(low + SQUARE_M + AROUND_M))
        box = shapely.box(*around)
        ways, areas = [], []
        for i in np.sort(self._trees[0].query(box)).tolist():
            way = self._ground.ways[i]
            for part in shapely.get_parts(shapely.clip_by_rect(way.line, *around)):
                if part.geom_type == "LineString" and part.length > 0:
                    ways.append(replace(way, line=part))
        for i in np.sort(self._trees[1].query(box)).tolist():
            area = self._ground.areas[i]
            part = shapely.normalize(shapely.clip_by_rect(area.outline, *around))
            if part.area > 0:
                areas.append(replace(area, outline=part))
        return Piece((float(low[0]), float(low[1])), tuple(ways), tuple(areas))

    @cached_property
    def _trees(self) -> tuple[shapely.STRtree, shapely.STRtree]:
        ground = self._ground
        return shapely.STRtree([way.line for way in ground.ways]), shapely.STRtree(
            [one.outline for one in ground.areas]
        )


def _joined(square: np.ndarray, squares: Sequence[tuple[int, ...]], parts: Sequence[tuple[np.ndarray, ...]]) -> Drawn:
    if len(parts) == 1:
        layers, layer, inside, first, edges, frames, frame, marks, mark = parts[0]
    else:
        empty = (
            np.zeros(1, np.int64),
            np.zeros(0, np.uint8),
            np.zeros(0, np.bool_),
            np.zeros(1, np.int64),
            np.zeros((0, 5)),
        )
        more = (np.zeros(1, np.int64), np.zeros((0, 9)), np.zeros(1, np.int64), np.zeros((0, 8)))
        columns = list(zip(*parts, strict=True)) or [(one,) for one in (*empty, *more)]
        layers, first, frames, marks = (_starts(columns[k]) for k in (0, 3, 5, 7))
        layer, inside, edges, frame, mark = (np.concatenate(columns[k]) for k in (1, 2, 4, 6, 8))
    low = np.array(squares, np.float64).reshape(-1, 2) * SQUARE_M
    return Drawn(square, low, layers, layer, inside, first, edges, frames, frame, marks, mark)


def _starts(parts: Sequence[np.ndarray]) -> np.ndarray:
    before = np.cumsum([0, *(int(part[-1]) for part in parts)])
    return np.concatenate(
        [np.zeros(1, np.int64), *(part[1:] + start for part, start in zip(parts, before[:-1], strict=True))]
    )


def draw(piece: Piece) -> tuple[np.ndarray, ...]:
    """A square's part of Drawn, from start_layer on."""
    roads = [way for way in piece.ways if way.kind == "road"]
    carriageway, junctions = carriageways(roads)
    layers = layers_of(piece.areas, piece.ways, carriageway)
    frames = _frames(roads)
    drawn = marks(piece.ways, carriageway, junctions)
    low = np.array(piece.low)
    return (*_by_layer(low, layers), *_nearest(low, frames), *_listed(low, drawn))


def _frames(roads: Sequence[Way]) -> np.ndarray:
    rows = [np.zeros((0, 9))]
    for way in roads:
        points = np.asarray(way.line.coords)
        driven = way.width - sum(way.parking)
        lane = driven / max(way.lanes, 1 if way.oneway or way.width < 4.5 else 2)
        values = [way.width / 2, SURFACES.index(way.surface), way.rank, lane]
        straight = _straight(np.column_stack([points[:-1], points[1:]]))
        rows.append(np.column_stack([straight, np.tile(values, (len(straight), 1))]))
    return np.concatenate(rows)


def _straight(ends: np.ndarray) -> np.ndarray:
    """Straight pieces (k, 5), of x0, y0, x1, y1 (n, 4), those of no length left out."""
    run = ends[:, 2:4] - ends[:, :2]
    length = np.hypot(*run.T)
    some = length > 0
    return np.column_stack([ends[some, :2], run[some] / length[some, None], length[some]])


def _cells(low: np.ndarray) -> np.ndarray:
    """The middles (cells, 2), row by row from the south-west."""
    row, column = np.divmod(np.arange(CELLS * CELLS), CELLS)
    return low + CELL_M * (np.column_stack([column, row]) + 0.5)


def _by_layer(low: np.ndarray, layers: dict[int, shapely.Geometry]) -> tuple[np.ndarray, ...]:
    middle = _cells(low)
    points, count = shapely.points(middle), len(middle)
    box = shapely.box(*(low - 3 * CELL_M), *(low + SQUARE_M + 3 * CELL_M))
    reach = CELL_M * np.sqrt(0.5) + REACH_M
    covered = np.zeros(count, np.int64)  # the first layer that is seen
    found = []
    for layer, shape in layers.items():
        inside = shapely.contains_xy(shape, middle[:, 0], middle[:, 1])
        rings = shapely.get_rings(shapely.get_parts(shape))
        corners, ring = shapely.get_coordinates(rings, return_index=True)
        same = ring[1:] == ring[:-1]
        ends = np.column_stack([corners[:-1][same], corners[1:][same]])
        edges = _straight(
            ends[shapely.intersects(shapely.linestrings(ends.reshape(-1, 2, 2)), box)] if len(ends) else ends
        )
        ends = np.column_stack([edges[:, :2], edges[:, :2] + edges[:, 2:4] * edges[:, 4:]]).reshape(-1, 2, 2)
        cell, edge = shapely.STRtree(shapely.linestrings(ends)).query(points, predicate="dwithin", distance=reach)
        beside = np.bincount(cell, minlength=count) > 0
        covered[inside & ~beside] = layer
        found.append((layer, inside, inside | beside, cell, edges[edge]))
    listed = [(layer, inside, some & (covered <= layer), cell, edges) for layer, inside, some, cell, edges in found]
    cells = np.concatenate([np.flatnonzero(some) for _, _, some, _, _ in listed] or [np.zeros(0, np.int64)])
    layer_of = np.concatenate(
        [np.full(some.sum(), layer, np.uint8) for layer, _, some, _, _ in listed] or [np.zeros(0, np.uint8)]
    )
    inside_of = np.concatenate([inside[some] for _, inside, some, _, _ in listed] or [np.zeros(0, np.bool_)])
    edge_key = [np.zeros(0, np.int64)] + [ROAD_KEYS * cell[some[cell]] + layer for layer, _, some, cell, _ in listed]
    edges = np.concatenate([np.zeros((0, 5))] + [edges[some[cell]] for _, _, some, cell, edges in listed])
    keys, order = ROAD_KEYS * cells + layer_of, np.concatenate(edge_key)
    by_cell, by_entry = np.argsort(keys, kind="stable"), np.argsort(order, kind="stable")
    first = np.append(np.searchsorted(order[by_entry], keys[by_cell]), len(order))
    start = np.searchsorted(cells[by_cell], np.arange(count + 1))
    return start, layer_of[by_cell], inside_of[by_cell], first, edges[by_entry]


def _nearest(low: np.ndarray, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of each cell the frames that may be nearest to a place in it, by their distance less half a width."""
    if not len(frames):
        return np.zeros(CELLS * CELLS + 1, np.int64), np.zeros((0, 9))
    middle = _cells(low)
    away = _away(middle, frames)
    near = (away <= away.min(axis=1, keepdims=True) + CELL_M * np.sqrt(2.0)) & (away < AROUND_M - CELL_M)
    near |= away < CELL_M  # on whose carriageway a place may lie
    cell, frame = np.nonzero(near)
    order = np.lexsort((frame, frames[frame, 7], cell))
    return np.searchsorted(cell[order], np.arange(CELLS * CELLS + 1)), frames[frame[order]]


def _away(points: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Distances (n, f) of points (n, 2) from frames less half their widths."""
    off = points[:, None] - frames[:, :2]
    run = np.clip((off * frames[:, 2:4]).sum(axis=2), 0, frames[:, 4])
    return np.linalg.norm(off - run[..., None] * frames[:, 2:4], axis=2) - frames[:, 5]


def _listed(low: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    straight = np.column_stack([_straight(rows[:, :4]), rows[:, 4:]])
    ends = np.column_stack([rows[:, :4]]).reshape(-1, 2, 2)
    lines, points = shapely.linestrings(ends), shapely.points(_cells(low))
    reach = CELL_M * np.sqrt(0.5) + REACH_M / 2
    most = float(rows[:, 4].max(initial=0.0))
    cell, mark = shapely.STRtree(lines).query(points, predicate="dwithin", distance=reach + most)
    near = shapely.distance(lines[mark], points[cell]) <= reach + rows[mark, 4]
    order = np.lexsort((mark[near], cell[near]))
    return np.searchsorted(cell[near][order], np.arange(CELLS * CELLS + 1)), straight[mark[near][order]]
