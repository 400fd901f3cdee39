"""Geometry of a factored wall: cells of grain between its units, recessed panes, and light per vertex."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import shapely
from shapely import Polygon

from facade_core.core.arrays import Float32Array, Float64Array, FloatArray, Int64Array, IntArray, ObjectArray
from facade_core.core.linear_light import srgb_to_linear
from facade_core.export.bodies.mouldings import WallBand
from facade_core.export.bodies.recess import WallSpace, recess_opening
from facade_core.export.bodies.settings import WALL_OPENINGS
from facade_core.export.factored.library import mean_light
from facade_core.export.factored.settings import FACTORED_WALLS, WALL_GRAINS
from facade_core.export.factored.units import FacadeUnit, Rectangle
from facade_core.export.factored.wall_decomposition import WallDecomposition
from facade_core.geometry.charts import Charts

# Picture of triangles: "grain", "moulding" or "type", the library, and the band or type in it.
TextureKey = tuple[str, int, int]


class WallPiece(NamedTuple):
    """Triangles of a wall with one picture.

    Attributes
    ----------
    position : (v, 3) world metres.
    normal : (v, 3) unit vectors.
    place : (v, 2) position on the picture, v down: shares of it, metres for grains.
    light : (v, 3) linear factor on the picture.
    triangles : (t, 3) vertex indices.
    chart : chart of the wall.
    """

    position: Float64Array
    normal: Float64Array
    place: Float64Array
    light: FloatArray
    triangles: IntArray
    chart: int


@dataclass(eq=False)
class WallPieces:
    """Wall pieces by picture.

    Attributes
    ----------
    by_picture : the pieces.
    elements : picture and pixels per metre of every inserted unit.
    """

    by_picture: dict[TextureKey, list[WallPiece]] = field(default_factory=dict)
    elements: list[tuple[TextureKey, float]] = field(default_factory=list)

    def add(self, key: TextureKey, piece: WallPiece) -> None:
        """Add a piece with its picture, unless it has no triangles."""
        if len(piece.triangles):
            self.by_picture.setdefault(key, []).append(piece)


class WallPolygon(NamedTuple):
    """Polygon of a wall.

    Attributes
    ----------
    outline : outline in the chart's frame.
    corners : (k, 3) corners, world metres.
    """

    outline: Polygon
    corners: Float64Array


def is_planar_and_valid(plane: WallPolygon) -> bool:
    """Return True if a polygon is planar and valid."""
    middle = plane.corners.mean(axis=0)
    _, _, axes = np.linalg.svd(plane.corners - middle, full_matrices=False)
    return (
        bool(np.abs((plane.corners - middle) @ axes[2]).max() <= FACTORED_WALLS.max_off_wall_plane_m)
        and plane.outline.is_valid
    )


class WallDetailLevel(NamedTuple):
    """Settings of one level of detail of a wall.

    Attributes
    ----------
    level : level of the variations that selects types.
    cell_m : side of the wall's cells, metres.
    has_recesses : True if panes are recessed.
    """

    level: int
    cell_m: float
    has_recesses: bool


# Detail as photographed.
NEAR_DETAIL = WallDetailLevel(0, 1.25, True)
# Detail from distances where recesses are invisible, with the fewest types.
FAR_DETAIL = WallDetailLevel(sys.maxsize, 2.5, False)


def build_wall(
    decomposition: WallDecomposition,
    planes: Sequence[WallPolygon],
    charts: Charts,
    library_index: int,
    detail: WallDetailLevel,
    behind: list[Float64Array],
    pieces: WallPieces,
) -> None:
    """Build the pieces of a wall from its library.

    Parameters
    ----------
    decomposition : units and bands of the wall.
    planes : polygons of the wall.
    charts : charts of the mesh.
    library_index : number of the library.
    detail : level of detail.
    behind : triangles behind the wall, as in `bodies.recess.WallSpace`; changed in place.
    pieces : pieces of the building; changed in place.
    """
    offset = WALL_GRAINS.repeat_m * np.random.default_rng(decomposition.facade.chart).random(2)
    for plane in planes:
        wall = _WallBuilder(charts, plane, decomposition, library_index, detail, offset, pieces)
        free = plane.outline
        for unit, own in decomposition.units:
            free = wall.insert_unit(unit, decomposition.library.unit_type(own, detail.level), free, behind)
        for band, shown, shade in decomposition.bands:
            wall.fill_band(band, shown, shade, free)


@dataclass(frozen=True, eq=False)
class _WallBuilder:
    """Builder of one polygon of a wall."""

    charts: Charts
    plane: WallPolygon
    decomposition: WallDecomposition
    library_index: int
    detail: WallDetailLevel
    offset: Float64Array
    pieces: WallPieces

    @property
    def chart(self) -> int:
        return self.decomposition.facade.chart

    def space(self, behind: Sequence[Float64Array]) -> WallSpace:
        """Return the space of the polygon with the surfaces behind it."""
        return WallSpace(self.charts, self.chart, self.plane.corners, behind)

    def points(self, places: Float64Array) -> Float64Array:
        """Project places (n, 2) of the chart's frame on the plane of the polygon, (n, 3)."""
        return self.space(()).points(places)

    def fill_band(self, band: WallBand, own: int | None, shade: Float32Array, free: shapely.Geometry) -> None:
        """Fill the free part of a band."""
        x0, y0, x1, y1 = free.bounds
        last = band is self.decomposition.bands[-1][0]
        # the end of a raster differs from that of its wall by up to a texel
        top, foot = max(band.top, y0) if band.top > 0 else y0, y1 if last else min(band.foot, y1)
        if foot <= top:
            return
        moulding = None if own is None else self.decomposition.library.mouldings.get(own)
        number = own if own is not None else -1
        if moulding is None:
            rows = max(1, round((foot - top) / self.detail.cell_m))
            corners, _ = _cut_cells(free, (x0, top, x1, foot), self.detail.cell_m, rows)
            if len(corners):
                light: FloatArray = self._sample_light(shade, band, corners.reshape(-1, 2))
                self._add_piece(("grain", self.library_index, number), corners, corners + self.offset, light)
            return
        corners, left = _cut_cells(free, (x0, top, x1, foot), moulding.width_m, 1)
        if len(corners):
            across = (corners[..., 0] - left[:, None]) / moulding.width_m
            place = np.stack([across, (corners[..., 1] - top) / (foot - top)], axis=-1)
            light = self._sample_light(shade, band, corners.reshape(-1, 2)) / np.maximum(moulding.colour, 1e-4)
            self._add_piece(("moulding", self.library_index, number), corners, place, light)

    def insert_unit(
        self, unit: FacadeUnit, shown: int, free: shapely.Geometry, behind: list[Float64Array]
    ) -> shapely.Geometry:
        """Insert a unit into the free part of the wall and return the rest."""
        kind, density = self.decomposition.library.types[shown], self.decomposition.facade.density
        x0, y0, x1, y1 = unit.box
        a, b, c, d = kind.box
        step = np.array([(x1 - x0) / (c - a), (y1 - y0) / (d - b)])
        corner = np.array([x0, y0]) - step * [a, b]
        height, width = kind.picture.shape[:2]
        whole = shapely.box(*corner, *(corner + step * [width, height]))
        area = _largest_polygon(whole.intersection(free))
        if area is None or area.area < 0.3 * whole.area:
            return free
        rest = free.difference(area)
        size = np.array([width, height])
        own = mean_light(self.decomposition.wall_light, _make_rectangle(corner, corner + step * size), density)
        light = self._clip_factor(own / np.maximum(kind.wall_light, 1e-4))
        key: TextureKey = ("type", self.library_index, shown)
        inner = self.plane.outline.buffer(-WALL_OPENINGS.wall_edge_m, join_style="mitre").intersection(
            area.buffer(-WALL_OPENINGS.wall_edge_m / 2)
        )
        ring: shapely.Geometry = area
        for left, top, right, foot in kind.panes if self.detail.has_recesses else ():
            box = _make_rectangle(corner + step * [left, top], corner + step * [right, foot])
            pane = _largest_polygon(shapely.box(*box).intersection(inner))
            if (
                pane is None
                or pane.area < WALL_OPENINGS.min_opening_m2
                or pane.buffer(-WALL_OPENINGS.min_opening_width_m / 2).is_empty
            ):
                continue
            pane = shapely.orient_polygons(pane.simplify(WALL_OPENINGS.wall_edge_m / 4), exterior_cw=True)
            found = recess_opening(pane, self.decomposition.recess_depth(pane.centroid), self.space(behind))
            if not found.depth:
                continue
            behind.append(found.triangles())
            ring = ring.difference(pane)
            rows, columns = (
                slice(max(0, round(low)), max(round(low), 0, round(high) - 1) + 1)
                for low, high in ((top, foot), (left, right))
            )
            mine = srgb_to_linear(kind.picture[rows, columns]).mean(axis=(0, 1))
            within = self._clip_factor(mean_light(self.decomposition.light, box, density) / np.maximum(mine, 1e-4))
            corners, _ = _triangulate_areas(np.array([pane]))
            self._add_piece(key, corners, ((corners - corner) / step) / size, within, found.depth)
            self._add_reveals(found.reveals())
        corners, _ = _triangulate_areas(np.array([ring]))
        self._add_piece(key, corners, ((corners - corner) / step) / size, light)
        self.pieces.elements.append((key, float(1 / step.max())))
        return rest

    def _clip_factor(self, factor: FloatArray) -> FloatArray:
        return np.clip(factor, FACTORED_WALLS.min_light_factor, FACTORED_WALLS.max_light_factor)

    def _add_reveals(self, faces: Sequence[tuple[Float64Array, Float64Array]]) -> None:
        for ring, flat in faces:
            found = self.decomposition.nearest_grain(float(flat[:, 1].mean()))
            if found is None:
                continue
            own, shade, band = found
            normal = np.cross(ring[1] - ring[0], ring[3] - ring[0])
            light = FACTORED_WALLS.reveal_light * self._sample_light(shade, band, flat)
            piece = WallPiece(
                ring,
                np.tile(normal / max(float(np.linalg.norm(normal)), 1e-12), (4, 1)),
                flat + self.offset,
                light,
                np.array([[0, 1, 2], [0, 2, 3]]),
                self.chart,
            )
            self.pieces.add(("grain", self.library_index, own), piece)

    def _sample_light(self, shade: Float32Array, band: WallBand, places: Float64Array) -> Float32Array:
        """Sample the light of a band at places (n, 2), (n, 3)."""
        import cv2

        density = self.decomposition.facade.density
        x = places[:, 0] * density - 0.5
        y = (places[:, 1] - band.top) * density - 0.5 if len(shade) > 1 else np.zeros(len(places))
        across, down = (part.astype(np.float32)[:, None] for part in (x, y))
        sampled = cv2.remap(shade, across, down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(sampled, shade.dtype).reshape(-1, 3)

    def _add_piece(
        self, key: TextureKey, corners: Float64Array, place: Float64Array, light: FloatArray, depth: float = 0.0
    ) -> None:
        """Add triangles (t, 3, 2) with places (t, 3, 2) and light (3,) or (3 t, 3); identical corners are merged."""
        if not len(corners):
            return
        rows = np.concatenate([corners.reshape(-1, 2), place.reshape(-1, 2)], axis=1)
        _, first, index = np.unique(
            np.rint(rows * 1e5).astype(np.int64), axis=0, return_index=True, return_inverse=True
        )
        out = self.charts.normals()[self.chart]
        self.pieces.add(
            key,
            WallPiece(
                self.points(rows[first, :2]) - depth * out,
                np.tile(out, (len(first), 1)),
                rows[first, 2:],
                np.broadcast_to(light, (len(rows), 3))[first],
                index.reshape(-1, 3),
                self.chart,
            ),
        )


def _make_rectangle(low: Float64Array, high: Float64Array) -> Rectangle:
    (x0, y0), (x1, y1) = low.tolist(), high.tolist()
    return x0, y0, x1, y1


def _largest_polygon(area: shapely.Geometry) -> Polygon | None:
    parts = [part for part in shapely.get_parts(area) if part.geom_type == "Polygon" and part.area > 1e-4]
    return max(parts, key=lambda part: part.area, default=None)


def _cut_cells(free: shapely.Geometry, bounds: Rectangle, width: float, rows: int) -> tuple[Float64Array, Float64Array]:
    """Cut the free part of a wall into cells of a width, in some rows between its bounds.

    Returns
    -------
    Triangles (t, 3, 2), and the left side (t,) of the cell of each.
    """
    x0, top, x1, foot = bounds
    across = np.arange(np.floor(x0 / width), np.ceil(x1 / width) + 1) * width
    down = np.linspace(top, foot, rows + 1)
    boxes = shapely.box(
        *(side.ravel() for side in np.meshgrid(across[:-1], down[:-1])),
        *(side.ravel() for side in np.meshgrid(across[1:], down[1:])),
    )
    corners, cell = _triangulate_areas(shapely.intersection(boxes, free))
    return corners, across[:-1][cell % (len(across) - 1)]


def _triangulate_areas(areas: ObjectArray) -> tuple[Float64Array, Int64Array]:
    """Triangulate areas (n,) to (t, 3, 2), counter-clockwise with y down, and return the area of each triangle."""
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
