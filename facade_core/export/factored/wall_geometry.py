"""One wall as triangles: cells of its material between its units, these set back in it, each with its light."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import shapely
from shapely import Polygon

from facade_core.core.linear_light import linear
from facade_core.export.bodies.mouldings import Band
from facade_core.export.bodies.openings import EDGE_M, NARROWEST_M, SMALLEST_OPENING_M2
from facade_core.export.bodies.recess import cut
from facade_core.export.factored.image_quilting import REPEAT_M
from facade_core.export.factored.library import mean_in
from facade_core.export.factored.units import Rectangle, Unit
from facade_core.export.factored.wall_decomposition import Seen
from facade_core.geometry.charts import Charts

# What of the sky the sides of an opening see: they are darker by this.
IN_REVEAL = 0.7
# What multiplies an element's picture lies within these, so that a wrong type is no black window.
LIGHTER, DARKER = 2.0, 0.4
# A corner of a wall lies no farther off its plane, metres; else it is left as it was.
FLAT_M = 0.02

# Which picture triangles show: of a library the grain or the moulding of a band, or a type.
Key = tuple[str, int, int]


class Piece(NamedTuple):
    """Triangles (t, 3) of vertices (v, ...): position in the world, metres; normal; place on the picture, shares of it, of a
    grain metres, v down; light, what multiplies the picture, linear; rows: of the chart."""

    position: np.ndarray
    normal: np.ndarray
    place: np.ndarray
    light: np.ndarray
    triangles: np.ndarray
    chart: int


@dataclass(eq=False)
class Pieces:
    """What was laid so far, by picture; elements: metres across and pixels across of every one that was set."""

    by_picture: dict[Key, list[Piece]] = field(default_factory=dict)
    elements: list[tuple[Key, float]] = field(default_factory=list)

    def add(self, key: Key, piece: Piece) -> None:
        if len(piece.triangles):
            self.by_picture.setdefault(key, []).append(piece)


class Plane(NamedTuple):
    """A polygon of a wall: its outline in the chart's frame and its corners (k, 3) in the world."""

    outline: Polygon
    corners: np.ndarray


def flat(plane: Plane) -> bool:
    """Whether a polygon is plane enough to be laid anew."""
    middle = plane.corners.mean(axis=0)
    _, _, axes = np.linalg.svd(plane.corners - middle, full_matrices=False)
    return bool(np.abs((plane.corners - middle) @ axes[2]).max() <= FLAT_M) and plane.outline.is_valid


class Detail(NamedTuple):
    """How closely walls are shown: the level of the variations whose types they have, the last where there are fewer; sides of
    a wall's cells, metres; whether panes lie back in it."""

    level: int
    cell: float
    deep: bool


# As photographed; and from where no pane is seen to lie back: with the fewest types.
NEAR, FAR = Detail(0, 1.25, True), Detail(sys.maxsize, 2.5, False)


def lay(
    seen: Seen,
    planes: Sequence[Plane],
    charts: Charts,
    number: int,
    detail: Detail,
    behind: list[np.ndarray],
    pieces: Pieces,
) -> None:
    """Lay a wall of plane polygons as pieces of its library, the number-th; behind as in `bodies.recess.cut`."""
    offset = REPEAT_M * np.random.default_rng(seen.facade.chart).random(2)
    for plane in planes:
        wall = _Wall(charts, plane, seen, number, detail, offset, pieces)
        free = plane.outline
        for unit, own in seen.units:
            free = wall.set_in(unit, seen.library.type_at(own, detail.level), free, behind)
        for band, shown, shade in seen.bands:
            wall.fill(band, shown, shade, free)


@dataclass(frozen=True, eq=False)
class _Wall:
    """A polygon of a wall that is laid."""

    charts: Charts
    plane: Plane
    seen: Seen
    number: int
    detail: Detail
    offset: np.ndarray
    pieces: Pieces

    @property
    def chart(self) -> int:
        return self.seen.facade.chart

    def points(self, places: np.ndarray) -> np.ndarray:
        """Places (n, 2) of the chart's frame on the polygon's plane, (n, 3)."""
        corners = self.plane.corners
        points, out = self.charts.points(self.chart, *places.T), self.charts.normal()[self.chart]
        middle = corners.mean(axis=0)
        _, _, axes = np.linalg.svd(corners - middle, full_matrices=False)
        return points + np.outer((middle - points) @ axes[2] / (out @ axes[2]), out)

    def fill(self, band: Band, own: int | None, shade: np.ndarray, free: shapely.Geometry) -> None:
        """Lay what is free of a band."""
        x0, y0, x1, y1 = free.bounds
        last = band is self.seen.bands[-1][0]
        # a raster ends at most a texel before or behind its wall
        top, foot = max(band.top, y0) if band.top > 0 else y0, y1 if last else min(band.foot, y1)
        if foot <= top:
            return
        moulding = None if own is None else self.seen.library.mouldings.get(own)
        wide = moulding.wide if moulding is not None else self.detail.cell
        across = np.arange(np.floor(x0 / wide), np.ceil(x1 / wide) + 1) * wide
        rows = 1 if moulding is not None else max(1, round((foot - top) / self.detail.cell))
        down = np.linspace(top, foot, rows + 1)
        boxes = shapely.box(
            *(side.ravel() for side in np.meshgrid(across[:-1], down[:-1])),
            *(side.ravel() for side in np.meshgrid(across[1:], down[1:])),
        )
        corners, cell = _triangles(shapely.intersection(boxes, free))
        if not len(corners):
            return
        if moulding is not None:
            left = across[:-1][cell % (len(across) - 1)]
            place = np.stack(
                [(corners[..., 0] - left[:, None]) / wide, (corners[..., 1] - top) / (foot - top)], axis=-1
            )
            light = self._at(shade, band, corners.reshape(-1, 2)) / np.maximum(moulding.colour, 1e-4)
            key: Key = ("moulding", self.number, own if own is not None else -1)
        else:
            place = corners + self.offset
            light = self._at(shade, band, corners.reshape(-1, 2))
            key = ("grain", self.number, own if own is not None else -1)
        self._add(key, corners, place, light)

    def set_in(self, unit: Unit, shown: int, free: shapely.Geometry, behind: list[np.ndarray]) -> shapely.Geometry:
        """Set a unit into what is free of the wall; what is left free."""
        kind, density = self.seen.library.types[shown], self.seen.facade.density
        x0, y0, x1, y1 = unit.box
        a, b, c, d = kind.box
        step = np.array([(x1 - x0) / (c - a), (y1 - y0) / (d - b)])
        corner = np.array([x0, y0]) - step * [a, b]
        height, width = kind.picture.shape[:2]
        whole = shapely.box(*corner, *(corner + step * [width, height]))
        area = _largest(whole.intersection(free))
        if area is None or area.area < 0.3 * whole.area:
            return free
        rest = free.difference(area)
        size = np.array([width, height])
        own = mean_in(self.seen.around, _box(corner, corner + step * size), density)
        light = np.clip(own / np.maximum(kind.wall, 1e-4), DARKER, LIGHTER)
        key: Key = ("type", self.number, shown)
        inner = self.plane.outline.buffer(-EDGE_M, join_style="mitre").intersection(area.buffer(-EDGE_M / 2))
        ring: shapely.Geometry = area
        for left, top, right, foot in kind.panes if self.detail.deep else ():
            box = _box(corner + step * [left, top], corner + step * [right, foot])
            pane = _largest(shapely.box(*box).intersection(inner))
            if pane is None or pane.area < SMALLEST_OPENING_M2 or pane.buffer(-NARROWEST_M / 2).is_empty:
                continue
            pane = shapely.orient_polygons(pane.simplify(EDGE_M / 4), exterior_cw=True)
            found = cut(pane, self.charts, self.chart, self.plane.corners, behind)
            if not found.depth:
                continue
            ring = ring.difference(pane)
            rows, columns = (
                slice(max(0, round(low)), max(round(low), 0, round(high) - 1) + 1)
                for low, high in ((top, foot), (left, right))
            )
            mine = linear(kind.picture[rows, columns]).mean(axis=(0, 1))
            within = np.clip(mean_in(self.seen.light, box, density) / np.maximum(mine, 1e-4), DARKER, LIGHTER)
            corners, _ = _triangles(np.array([pane]))
            self._add(key, corners, ((corners - corner) / step) / size, within, found.depth)
            self._reveals(found.reveals())
        corners, _ = _triangles(np.array([ring]))
        self._add(key, corners, ((corners - corner) / step) / size, light)
        self.pieces.elements.append((key, float(1 / step.max())))
        return rest

    def _reveals(self, faces: Sequence[tuple[np.ndarray, np.ndarray]]) -> None:
        for ring, flat in faces:
            found = self.seen.grain_at(float(flat[:, 1].mean()))
            if found is None:
                continue
            own, shade, band = found
            normal = np.cross(ring[1] - ring[0], ring[3] - ring[0])
            light = IN_REVEAL * self._at(shade, band, flat)
            piece = Piece(
                ring,
                np.tile(normal / max(float(np.linalg.norm(normal)), 1e-12), (4, 1)),
                flat + self.offset,
                light,
                np.array([[0, 1, 2], [0, 2, 3]]),
                self.chart,
            )
            self.pieces.add(("grain", self.number, own), piece)

    def _at(self, shade: np.ndarray, band: Band, places: np.ndarray) -> np.ndarray:
        """A band's light at places (n, 2), (n, 3)."""
        import cv2

        density = self.seen.facade.density
        x = places[:, 0] * density - 0.5
        y = (places[:, 1] - band.top) * density - 0.5 if len(shade) > 1 else np.zeros(len(places))
        across, down = (part.astype(np.float32)[:, None] for part in (x, y))
        return np.asarray(cv2.remap(shade, across, down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)).reshape(
            -1, 3
        )

    def _add(self, key: Key, corners: np.ndarray, place: np.ndarray, light: np.ndarray, depth: float = 0.0) -> None:
        """Triangles with corners (t, 3, 2) in the chart's frame, places on their picture (t, 3, 2) and light (3,) or (3 t, 3);
        corners that have all the same are one."""
        if not len(corners):
            return
        rows = np.concatenate([corners.reshape(-1, 2), place.reshape(-1, 2)], axis=1)
        _, first, index = np.unique(
            np.rint(rows * 1e5).astype(np.int64), axis=0, return_index=True, return_inverse=True
        )
        out = self.charts.normal()[self.chart]
        self.pieces.add(
            key,
            Piece(
                self.points(rows[first, :2]) - depth * out,
                np.tile(out, (len(first), 1)),
                rows[first, 2:],
                np.broadcast_to(light, (len(rows), 3))[first],
                index.reshape(-1, 3),
                self.chart,
            ),
        )


def _box(low: np.ndarray, high: np.ndarray) -> Rectangle:
    (x0, y0), (x1, y1) = low.tolist(), high.tolist()
    return x0, y0, x1, y1


def _largest(area: shapely.Geometry) -> Polygon | None:
    parts = [part for part in shapely.get_parts(area) if part.geom_type == "Polygon" and part.area > 1e-4]
    return max(parts, key=lambda part: part.area, default=None)


def _triangles(areas: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Areas (n,) as triangles (t, 3, 2), counter-clockwise as seen where y runs down, and which area each is of."""
    parts, of = shapely.get_parts(areas, return_index=True)
    plane = (shapely.get_type_id(parts) == shapely.GeometryType.POLYGON) & (shapely.area(parts) > 1e-6)
    cut_up, part = shapely.get_parts(shapely.constrained_delaunay_triangles(parts[plane]), return_index=True)
    if not len(cut_up):
        return np.zeros((0, 3, 2)), np.zeros(0, np.int64)
    corners = shapely.get_coordinates(cut_up).reshape(-1, 4, 2)[:, :3]
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    turned = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] > 0
    corners[turned] = corners[turned][:, ::-1]
    return corners, of[plane][part]
