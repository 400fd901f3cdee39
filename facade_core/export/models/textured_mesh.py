"""Textured mesh of a block, packed on texture pages, with one model node per building."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple, Protocol

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int32Array, Int64Array, IntArray, UInt8Array
from facade_core.core.grouping import group_rows
from facade_core.export.models.glb import GltfNode, Primitive
from facade_core.export.models.pages import (
    GUTTER_TEXELS,
    MAX_SHELF_PAGE_TEXELS,
    PageImages,
    PageLayout,
    PbrMaps,
    downscale,
    draw_page,
    encode_jpeg,
    halve_layout,
    lay_out_shelves,
)
from facade_core.export.models.settings import TEXTURED_MESHES
from facade_core.geometry.charts import Charts, Mesh
from facade_core.geometry.scene import Scene

GROUND_NODE = "ground"


class ModelFrame(Protocol):
    """Transform from world metres (n, 3) to the frame of a model; directions keep their length."""

    def points(self, world: Float64Array) -> Float64Array: ...

    def directions(self, world: Float64Array) -> Float64Array: ...


@dataclass(frozen=True)
class YUpFrame:
    """glTF frame around a local origin: x east, y up, z south of the grid.

    Attributes
    ----------
    origin : (3,) world metres.
    """

    origin: Float64Array

    def points(self, world: Float64Array) -> Float64Array:
        """Return points (n, 3) of the world in the frame, y up, metres."""
        return to_y_up(world - self.origin)

    def directions(self, world: Float64Array) -> Float64Array:
        """Return directions (n, 3) of the world in the frame."""
        return to_y_up(world)


def to_y_up(points: Float64Array) -> Float64Array:
    """Convert coordinates (n, 3) from z up to y up: (x, y, z) -> (x, z, -y)."""
    return np.column_stack([points[:, 0], points[:, 2], -points[:, 1]])


def mesh_y_up_frame(mesh: Mesh) -> YUpFrame:
    """Return the frame around the centre of a mesh in whole metres, at its lowest point."""
    points = mesh.vertices[mesh.triangles.reshape(-1)]
    low, high = points.min(axis=0), points.max(axis=0)
    return YUpFrame(np.append(((low + high) / 2)[:2].round(), np.floor(low[2])))


class VertexFrames(NamedTuple):
    """Frames of vertices that are not in the plane of their chart.

    Attributes
    ----------
    normals : (v, 3) outward unit vectors.
    coordinates : (v, 2) place that each shows, metres in the frame of its chart.
    tangents : (v, 4) unit vector of the texture to the right; 1, or -1 where the texture is mirrored.
    """

    normals: Float64Array
    coordinates: Float64Array
    tangents: Float64Array


@dataclass(frozen=True)
class TexturedMesh:
    """Mesh whose charts have a raster each.

    Attributes
    ----------
    charts : charts of the mesh.
    mesh : triangles, without those too small to be visible.
    extent : (n, 2) metres that each raster covers from its chart's origin.
    texels : (n, 2) width and height of each raster.
    raster : returns the raster (h, w, 3) uint8 of a chart.
    maps : returns the maps of a chart; None if the mesh is not relit.
    frames : frames of the vertices; None if all are in the plane of their chart.
    """

    charts: Charts
    mesh: Mesh
    extent: Float64Array
    texels: Int64Array
    raster: Callable[[int], UInt8Array]
    maps: Callable[[int], PbrMaps] | None = None
    frames: VertexFrames | None = None

    @cached_property
    def normals(self) -> Float64Array:
        """Return the outward normal of every vertex, (v, 3)."""
        return self.frames.normals if self.frames else self.charts.normals()[self.mesh.vertex_chart]

    @cached_property
    def coordinates(self) -> Float64Array:
        """Return the place in the frame of its chart that every vertex shows, (v, 2) metres."""
        return self.frames.coordinates if self.frames else self.mesh.chart_coordinates(self.charts)

    @cached_property
    def tangents(self) -> Float64Array:
        """Return the tangent of every vertex and its handedness, (v, 4), see `VertexFrames`."""
        if self.frames:
            return self.frames.tangents
        along = self.charts.axis_u[self.mesh.vertex_chart]
        return np.column_stack([along, np.ones(len(along))])

    @cached_property
    def max_offset_m(self) -> float:
        """Return the largest distance of a triangle's vertex from the plane of its chart, metres."""
        if not self.frames:
            return 0.0
        used = np.unique(self.mesh.triangles)
        chart = self.mesh.vertex_chart[used]
        offset = self.mesh.vertices[used] - self.charts.origin[chart]
        return float(np.abs((offset * self.charts.normals()[chart]).sum(axis=1)).max(initial=0.0))

    @cached_property
    def centres(self) -> Float64Array:
        """Return the centre of every chart, (n, 3) metres."""
        return self.charts.points(np.arange(len(self.charts)), *self.charts.size.T / 2)

    def select_charts(self, buildings: IntArray) -> Int64Array:
        """Return the charts with triangles of some buildings (-1 for ground)."""
        drawn = np.zeros(len(self.charts), bool)
        drawn[self.mesh.chart] = True
        return np.flatnonzero(drawn & np.isin(self.charts.building, buildings))


def triangle_areas(mesh: Mesh) -> Float64Array:
    """Return the area of every triangle, (t,) m2."""
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    areas: Float64Array = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    return areas


def build_textured_mesh(scene: Scene, read_page: Callable[[int], UInt8Array]) -> TexturedMesh:
    """Build the textured mesh of a block from its atlas pages.

    Parameters
    ----------
    scene : scene with the placement of its charts.
    read_page : returns an atlas page (h, w, 3) uint8; the last pages are cached.
    """
    held = lru_cache(maxsize=TEXTURED_MESHES.max_cached_pages)(read_page)
    placement, mesh = scene.placement, scene.mesh

    def raster(chart: int) -> UInt8Array:
        page, rows, columns = placement.region(chart)
        return held(page)[rows, columns]

    texels = np.column_stack([placement.width, placement.height]).astype(np.int64)
    return TexturedMesh(
        scene.charts,
        filter_triangles(mesh, triangle_areas(mesh) > TEXTURED_MESHES.min_triangle_m2),
        texels / placement.texels_per_metre[:, None],
        texels,
        raster,
    )


def filter_triangles(mesh: Mesh, keep: BoolArray) -> Mesh:
    """Return a mesh with the triangles where `keep` (t,) bool holds; vertices stay."""
    return Mesh(
        mesh.vertices, mesh.triangles[keep], mesh.chart[keep], mesh.vertex_chart, mesh.texture[keep], mesh.uv[keep]
    )


@dataclass(frozen=True)
class PackedCharts:
    """Charts of a textured mesh with their layout on pages.

    Attributes
    ----------
    source : the textured mesh.
    charts : (k,) chart ids, ascending.
    layout : layout of these charts.
    """

    source: TexturedMesh
    charts: Int64Array
    layout: PageLayout

    def texture_coordinates(self, chart: Int32Array, points: Float64Array) -> Float64Array:
        """Return the texture coordinates of points on their pages.

        Parameters
        ----------
        chart : (n,) chart of each point.
        points : (n, 2) metres in the frame of its chart.

        Returns
        -------
        (n, 2) 0 to 1, v down.
        """
        place, layout = np.searchsorted(self.charts, chart), self.layout
        share = np.clip(points / self.source.extent[chart], 0, 1)
        corner = np.column_stack([layout.x[place], layout.y[place]])
        return (corner + share * layout.size[place]) / layout.pages[layout.page[place]]


def pack_charts_on_pages(source: TexturedMesh, charts: Int64Array, scale: float = 1.0) -> PackedCharts:
    """Pack charts on pages, with neighbouring buildings on the same page.

    Parameters
    ----------
    source : the textured mesh.
    charts : (k,) chart ids, ascending.
    scale : factor on the texels of the charts.
    """
    size = np.maximum(1, np.ceil(source.texels[charts] * scale - 1e-6)).astype(np.int64)
    size = np.minimum(size, MAX_SHELF_PAGE_TEXELS - 2 * GUTTER_TEXELS)
    return PackedCharts(source, charts, lay_out_shelves(size, _rank_by_place(source, charts)))


def _rank_by_place(source: TexturedMesh, charts: Int64Array) -> Int64Array:
    """Return a rank per chart: one per building or piece of ground, along a space-filling curve."""
    if not len(charts):
        return np.zeros(0, np.int64)
    building = source.charts.building[charts]
    _, of = np.unique(np.where(building >= 0, building, -1 - charts), return_inverse=True)
    centre = source.centres[charts, :2]
    middle = np.stack([np.bincount(of, centre[:, k]) / np.bincount(of) for k in range(2)], axis=1)
    cell = ((middle - middle.min(axis=0)) / (np.ptp(middle, axis=0).max() + 1) * 65535).astype(np.int64)
    rank = np.empty(len(middle), np.int64)
    rank[np.argsort(_z_order(cell), kind="stable")] = np.arange(len(middle))
    return rank[of]


def _z_order(cell: Int64Array) -> Int64Array:
    """Return the Z-order code of cells (n, 2) of 16 bits."""
    code = np.zeros(len(cell), np.int64)
    for bit in range(16):
        for axis in range(2):
            code |= ((cell[:, axis] >> bit) & 1) << (2 * bit + axis)
    return code


def encode_pages(drawn: PackedCharts) -> list[bytes]:
    """Encode every page as JPEG."""
    return [encode_page(drawn, page) for page in range(len(drawn.layout.pages))]


def encode_page(drawn: PackedCharts, page: int) -> bytes:
    """Encode one page as JPEG."""
    return encode_jpeg(_draw_base_colour(drawn, page))


def draw_page_images(drawn: PackedCharts, page: int) -> PageImages:
    """Draw a page, with its maps if the source has them."""
    maps, half = drawn.source.maps, halve_layout(drawn.layout)
    return PageImages(
        _draw_base_colour(drawn, page),
        None
        if maps is None
        else draw_page_maps(drawn, page, lambda raster: draw_page(half, page, raster, GUTTER_TEXELS // 2)),
    )


def _draw_base_colour(drawn: PackedCharts, page: int) -> UInt8Array:
    def raster(i: int) -> UInt8Array:
        width, height = drawn.layout.size[i].tolist()
        return downscale(drawn.source.raster(int(drawn.charts[i])), (width, height))

    return draw_page(drawn.layout, page, raster)


def draw_page_maps(
    drawn: PackedCharts, page: int, draw: Callable[[Callable[[int], UInt8Array]], UInt8Array]
) -> PbrMaps:
    """Draw the maps of a page.

    Parameters
    ----------
    packed : charts with their layout.
    page : number of the page.
    draw : draws rasters of pieces, at half their texels, on the page.
    """
    assert drawn.source.maps is not None
    found: dict[int, tuple[UInt8Array | None, ...]] = {}
    for i in np.flatnonzero(drawn.layout.page == page).tolist():
        width, height = (-(-side // 2) for side in drawn.layout.size[i].tolist())
        maps = drawn.source.maps(int(drawn.charts[i]))
        found[i] = tuple(None if one is None else downscale(one, (width, height)) for one in maps)

    def kind(number: int) -> UInt8Array | None:
        if all(one[number] is None for one in found.values()):
            return None

        def raster(i: int) -> UInt8Array:
            """Return the map of a piece, black where it has none."""
            map_ = found[i][number]
            return np.zeros_like(found[i][0]) if map_ is None else map_

        return draw(raster)

    normal, orm, emissive = (kind(number) for number in range(3))
    assert normal is not None
    assert orm is not None
    return PbrMaps(normal, orm, emissive)


def turn_tangents(tangents: Float64Array, frame: ModelFrame) -> Float64Array:
    """Turn tangents (v, 4) of the world to the frame of a model."""
    return np.column_stack([frame.directions(tangents[:, :3]), tangents[:, 3]])


def build_nodes(
    drawn: Sequence[PackedCharts], names: Mapping[int, str], frame: ModelFrame
) -> tuple[list[GltfNode], Float64Array]:
    """Build one node per building in their order, then the ground.

    Parameters
    ----------
    parts : packed charts whose pages are numbered consecutively.
    names : name of each building.
    frame : frame of the model.

    Returns
    -------
    The nodes, and the bounds (2, 3) of the model in its frame.
    """
    primitives: dict[int, list[Primitive]] = {}
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    before = 0
    for part in drawn:
        source, mesh = part.source, part.source.mesh
        place = np.full(len(source.charts), -1, np.int64)
        place[part.charts] = np.arange(len(part.charts))
        mine = np.flatnonzero(place[mesh.chart] >= 0)
        page = part.layout.page[place[mesh.chart[mine]]]
        owner = source.charts.building[mesh.chart[mine]].astype(np.int64)
        pages = len(part.layout.pages)
        for code, here in group_rows((owner + 1) * pages + page).items():
            building, shown = code // pages - 1, code % pages
            triangles = mesh.triangles[mine[here]]
            used, index = np.unique(triangles, return_inverse=True)
            position = frame.points(mesh.vertices[used]).astype(np.float32)
            low, high = np.minimum(low, position.min(axis=0)), np.maximum(high, position.max(axis=0))
            primitives.setdefault(building, []).append(
                Primitive(
                    position,
                    frame.directions(source.normals[used]),
                    part.texture_coordinates(mesh.vertex_chart[used], source.coordinates[used]),
                    index.reshape(-1, 3),
                    before + shown,
                    turn_tangents(source.tangents[used], frame) if source.maps else None,
                )
            )
        before += len(part.layout.pages)
    owners = sorted(primitives, key=lambda owner: (owner < 0, owner))
    return [GltfNode(names.get(owner, GROUND_NODE), tuple(primitives[owner])) for owner in owners], np.array(
        [low, high]
    )
