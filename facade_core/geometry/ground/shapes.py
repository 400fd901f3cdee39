"""Lookup tables of the ground shapes for kernels, per tile of the world grid."""

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

from facade_core.core.arrays import AnyArray, BoolArray, Float64Array, Int32Array, Int64Array, IntArray, UInt8Array
from facade_core.core.types import SURFACES, GroundArea, GroundWay, MappedGround
from facade_core.geometry.charts import ChartKind, Charts
from facade_core.geometry.ground.layers import ground_layers, join_carriageways
from facade_core.geometry.ground.marks import ground_marks
from facade_core.geometry.ground.settings import SHAPES

# Side in metres of a lookup cell, which lists the shapes near it.
LOOKUP_CELL_M = 1.0
# Metres from a cell to the shapes that it lists; an edge is soft over twice that at most.
EDGE_REACH_M = 0.8
CELLS_PER_SIDE = round(SHAPES.ground_tile_m / LOOKUP_CELL_M)
# Greater than the number of layers.
LAYER_KEY_STRIDE = 256
# Version of the text by which a way enters digests; a new field of Way, or another order, raises it.
WAY_FORMAT = 1


class GroundTileArrays(NamedTuple):
    """Lookup tables of t tiles. Per cell, row by row, rows start[cell] to start[cell + 1] list the shapes near it.

    A straight piece begins with x, y, its direction east and north, and its length.

    Attributes
    ----------
    chart_tile : (charts,) tile of each chart, -1 for others.
    tile_origin : (t, 2) south-western corners in metres.
    start_layer : (t * cells + 1,) start of each cell in `layer`.
    layer : (e,) ground layer.
    inside : (e,) True where the cell's middle is inside the layer's shape.
    first_edge : (e + 1,) start of each entry in `edges`.
    edges : (k, 5) straight pieces with the inside on their left.
    start_road : (t * cells + 1,) start of each cell in `roads`.
    roads : (f, 9) straight pieces, half width, surface, rank, lane width.
    start_mark : (t * cells + 1,) start of each cell in `marks`.
    marks : (m, 8) straight pieces, half width, `GroundMarkKind`, 1 where round.
    """

    chart_tile: Int32Array
    tile_origin: Float64Array
    start_layer: Int64Array
    layer: UInt8Array
    inside: BoolArray
    first_edge: Int64Array
    edges: Float64Array
    start_road: Int64Array
    roads: Float64Array
    start_mark: Int64Array
    marks: Float64Array


def serialise_way_look(way: GroundWay) -> str:
    """Serialise what a way looks like, without id and line, as JSON for digests."""
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
class GroundTileShapes:
    """Ways and areas clipped to a tile of the world grid and its margin."""

    low: tuple[float, float]
    ways: tuple[GroundWay, ...]
    areas: tuple[GroundArea, ...]

    @property
    def digest(self) -> bytes:
        """Return the digest of everything that is drawn on the tile."""
        found = blake2b(repr(self.low).encode(), digest_size=16)
        for way in self.ways:
            found.update(shapely.to_wkb(way.line) + serialise_way_look(way).encode())
        for area in self.areas:
            found.update(shapely.to_wkb(area.outline) + area.surface.encode())
        return found.digest()


class GroundTiles:
    """Ground shapes of a block, cut to tiles of the world grid on demand."""

    def __init__(self, ground: MappedGround, charts: Charts) -> None:
        self._ground = ground
        middle = charts.points_at_shares(np.arange(len(charts)), np.array([[0.5, 0.5]]))[:, 0, :2]
        self._chart_tile = np.floor(middle / SHAPES.ground_tile_m).astype(np.int64)
        self._is_ground = charts.kind == ChartKind.GROUND
        self._digests: dict[tuple[int, ...], bytes] = {}
        self._arrays: OrderedDict[tuple[int, int], tuple[AnyArray, ...]] = OrderedDict()

    def build_arrays(self, charts: Sequence[int] | IntArray) -> GroundTileArrays:
        """Build the lookup tables of the ground charts among some charts."""
        tile_index = np.full(len(self._is_ground), -1, np.int32)
        own = [int(chart) for chart in charts if self._is_ground[chart]]
        tiles = sorted({tuple(self._chart_tile[chart].tolist()) for chart in own})
        number = {one: index for index, one in enumerate(tiles)}
        for chart in own:
            tile_index[chart] = number[tuple(self._chart_tile[chart].tolist())]
        return _join_tiles(tile_index, tiles, [self._tile_arrays(one) for one in tiles])

    def digest(self, chart: int) -> bytes:
        """Return the digest of everything that is drawn on a ground chart."""
        tile_index = tuple(self._chart_tile[chart].tolist())
        if tile_index not in self._digests:
            self._digests[tile_index] = self.cut_tile(tile_index).digest
        return self._digests[tile_index]

    def tile_around(self, chart: int) -> GroundTileShapes:
        """Return the tile of a ground chart."""
        return self.cut_tile(tuple(self._chart_tile[chart].tolist()))

    def _tile_arrays(self, tile_index: tuple[int, int]) -> tuple[AnyArray, ...]:
        if tile_index not in self._arrays:
            self._arrays[tile_index] = build_tile_arrays(self.cut_tile(tile_index))
            if len(self._arrays) > SHAPES.max_cached_tiles:
                self._arrays.popitem(last=False)
        return self._arrays[tile_index]

    def cut_tile(self, tile_index: tuple[int, ...]) -> GroundTileShapes:
        """Cut ways and areas to a tile, given by column and row."""
        low = np.array(tile_index) * SHAPES.ground_tile_m
        around = (*(low - SHAPES.ground_tile_margin_m), *(low + SHAPES.ground_tile_m + SHAPES.ground_tile_margin_m))
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
        return GroundTileShapes((float(low[0]), float(low[1])), tuple(ways), tuple(areas))

    @cached_property
    def _trees(self) -> tuple[shapely.STRtree, shapely.STRtree]:
        ground = self._ground
        return shapely.STRtree([way.line for way in ground.ways]), shapely.STRtree(
            [one.outline for one in ground.areas]
        )


def _join_tiles(
    tile_index: Int32Array, tiles: Sequence[tuple[int, ...]], parts: Sequence[tuple[AnyArray, ...]]
) -> GroundTileArrays:
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
        layers, first, frames, marks = (_join_starts(columns[k]) for k in (0, 3, 5, 7))
        layer, inside, edges, frame, mark = (np.concatenate(columns[k]) for k in (1, 2, 4, 6, 8))
    low = np.array(tiles, np.float64).reshape(-1, 2) * SHAPES.ground_tile_m
    return GroundTileArrays(tile_index, low, layers, layer, inside, first, edges, frames, frame, marks, mark)


def _join_starts(parts: Sequence[Int64Array]) -> Int64Array:
    before = np.cumsum([0, *(int(part[-1]) for part in parts)])
    return np.concatenate(
        [np.zeros(1, np.int64), *(part[1:] + start for part, start in zip(parts, before[:-1], strict=True))]
    )


def build_tile_arrays(piece: GroundTileShapes) -> tuple[AnyArray, ...]:
    """Build the columns of `GroundTileArrays` of one tile, from start_layer on."""
    roads = [way for way in piece.ways if way.kind == "road"]
    carriageway, junctions = join_carriageways(roads)
    layers = ground_layers(piece.areas, piece.ways, carriageway)
    frames = _road_segments(roads)
    drawn = ground_marks(piece.ways, carriageway, junctions)
    low = np.array(piece.low)
    return (*_list_layers(low, layers), *_list_roads(low, frames), *_list_marks(low, drawn))


def _road_segments(roads: Sequence[GroundWay]) -> Float64Array:
    rows = [np.zeros((0, 9))]
    for way in roads:
        points = np.asarray(way.line.coords)
        driven = way.width - sum(way.parking)
        lane = driven / max(way.lanes, 1 if way.oneway or way.width < 4.5 else 2)
        values = [way.width / 2, SURFACES.index(way.surface), way.rank, lane]
        straight = _straight_pieces(np.column_stack([points[:-1], points[1:]]))
        rows.append(np.column_stack([straight, np.tile(values, (len(straight), 1))]))
    return np.concatenate(rows)


def _straight_pieces(ends: Float64Array) -> Float64Array:
    """Return straight pieces (k, 5) of x0, y0, x1, y1 (n, 4), without those of no length."""
    run = ends[:, 2:4] - ends[:, :2]
    length = np.hypot(*run.T)
    some = length > 0
    return np.column_stack([ends[some, :2], run[some] / length[some, None], length[some]])


def _cell_middles(low: Float64Array) -> Float64Array:
    """Return the middles (cells, 2) of a tile's cells, row by row from the south-west."""
    row, column = np.divmod(np.arange(CELLS_PER_SIDE * CELLS_PER_SIDE), CELLS_PER_SIDE)
    return low + LOOKUP_CELL_M * (np.column_stack([column, row]) + 0.5)


def _list_layers(low: Float64Array, layers: dict[int, shapely.Geometry]) -> tuple[AnyArray, ...]:
    middle = _cell_middles(low)
    points, count = shapely.points(middle), len(middle)
    box = shapely.box(*(low - 3 * LOOKUP_CELL_M), *(low + SHAPES.ground_tile_m + 3 * LOOKUP_CELL_M))
    reach = LOOKUP_CELL_M * np.sqrt(0.5) + EDGE_REACH_M
    covered = np.zeros(count, np.int64)  # topmost layer that covers the cell wholly
    found = []
    for layer, shape in layers.items():
        inside = shapely.contains_xy(shape, middle[:, 0], middle[:, 1])
        rings = shapely.get_rings(shapely.get_parts(shape))
        corners, ring = shapely.get_coordinates(rings, return_index=True)
        same = ring[1:] == ring[:-1]
        ends = np.column_stack([corners[:-1][same], corners[1:][same]])
        edges = _straight_pieces(
            ends[shapely.intersects(shapely.linestrings(ends.reshape(-1, 2, 2)), box)] if len(ends) else ends
        )
        ends = np.column_stack([edges[:, :2], edges[:, :2] + edges[:, 2:4] * edges[:, 4:]]).reshape(-1, 2, 2)
        cell, edge = shapely.STRtree(shapely.linestrings(ends)).query(points, predicate="dwithin", distance=reach)
        near_edge = np.bincount(cell, minlength=count) > 0
        covered[inside & ~near_edge] = layer
        found.append((layer, inside, inside | near_edge, cell, edges[edge]))
    listed = [(layer, inside, some & (covered <= layer), cell, edges) for layer, inside, some, cell, edges in found]
    cells = np.concatenate([np.flatnonzero(some) for _, _, some, _, _ in listed] or [np.zeros(0, np.int64)])
    layer_of = np.concatenate(
        [np.full(some.sum(), layer, np.uint8) for layer, _, some, _, _ in listed] or [np.zeros(0, np.uint8)]
    )
    inside_of = np.concatenate([inside[some] for _, inside, some, _, _ in listed] or [np.zeros(0, np.bool_)])
    edge_key = [np.zeros(0, np.int64)] + [
        LAYER_KEY_STRIDE * cell[some[cell]] + layer for layer, _, some, cell, _ in listed
    ]
    edges = np.concatenate([np.zeros((0, 5))] + [edges[some[cell]] for _, _, some, cell, edges in listed])
    keys, order = LAYER_KEY_STRIDE * cells + layer_of, np.concatenate(edge_key)
    by_cell, by_entry = np.argsort(keys, kind="stable"), np.argsort(order, kind="stable")
    first = np.append(np.searchsorted(order[by_entry], keys[by_cell]), len(order))
    start = np.searchsorted(cells[by_cell], np.arange(count + 1))
    return start, layer_of[by_cell], inside_of[by_cell], first, edges[by_entry]


def _list_roads(low: Float64Array, frames: Float64Array) -> tuple[Int64Array, Float64Array]:
    """List per cell the road segments that may be nearest to a place in it, by distance less half width."""
    if not len(frames):
        return np.zeros(CELLS_PER_SIDE * CELLS_PER_SIDE + 1, np.int64), np.zeros((0, 9))
    middle = _cell_middles(low)
    away = _road_distances(middle, frames)
    near = (away <= away.min(axis=1, keepdims=True) + LOOKUP_CELL_M * np.sqrt(2.0)) & (
        away < SHAPES.ground_tile_margin_m - LOOKUP_CELL_M
    )
    near |= away < LOOKUP_CELL_M  # the carriageway may cover a place in the cell
    cell, frame = np.nonzero(near)
    order = np.lexsort((frame, frames[frame, 7], cell))
    return np.searchsorted(cell[order], np.arange(CELLS_PER_SIDE * CELLS_PER_SIDE + 1)), frames[frame[order]]


def _road_distances(points: Float64Array, frames: Float64Array) -> Float64Array:
    """Return distances (n, f) of points (n, 2) from road segments, less half their widths."""
    off = points[:, None] - frames[:, :2]
    run = np.clip((off * frames[:, 2:4]).sum(axis=2), 0, frames[:, 4])
    distances: Float64Array = np.linalg.norm(off - run[..., None] * frames[:, 2:4], axis=2) - frames[:, 5]
    return distances


def _list_marks(low: Float64Array, rows: Float64Array) -> tuple[Int64Array, Float64Array]:
    straight = np.column_stack([_straight_pieces(rows[:, :4]), rows[:, 4:]])
    ends = np.column_stack([rows[:, :4]]).reshape(-1, 2, 2)
    lines, points = shapely.linestrings(ends), shapely.points(_cell_middles(low))
    reach = LOOKUP_CELL_M * np.sqrt(0.5) + EDGE_REACH_M / 2
    most = float(rows[:, 4].max(initial=0.0))
    cell, mark = shapely.STRtree(lines).query(points, predicate="dwithin", distance=reach + most)
    near = shapely.distance(lines[mark], points[cell]) <= reach + rows[mark, 4]
    order = np.lexsort((mark[near], cell[near]))
    return np.searchsorted(cell[near][order], np.arange(CELLS_PER_SIDE * CELLS_PER_SIDE + 1)), straight[
        mark[near][order]
    ]
