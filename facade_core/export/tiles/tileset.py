"""3D Tiles 1.1: a quadtree of buildings, with coarse shells above and full textures below."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Required, TypedDict

import numpy as np

from facade_core.core.arrays import Float64Array, Int64Array, IntArray
from facade_core.core.grouping import group_rows
from facade_core.export.attribution import Attribution
from facade_core.export.models.encoders import MIPMAP_FACTOR, TextureEncoder
from facade_core.export.models.features import FeatureTable
from facade_core.export.models.gltf_materials import TimeOfDay, encode_textures, material_texel_ratio
from facade_core.export.models.textured_mesh import TexturedMesh, turn_tangents
from facade_core.export.surroundings.gltf import SurroundingModel, encode_surroundings_glb
from facade_core.export.tiles.cells import QuadtreeCell
from facade_core.export.tiles.earth import TilesetFrame
from facade_core.export.tiles.far_shells import BuildingShells
from facade_core.export.tiles.settings import TEXTURE_BUDGET, TILE_CELLS
from facade_core.export.tiles.tile_glb import TileBatch, encode_tile_glb
from facade_core.export.tiles.tile_pages import TilePages, pack_tile_pages

# Screen-space error of viewers, pixels: a tile is replaced once a texel covers a pixel.
ERROR_PIXELS = 16
# Tileset of what lies around a block, beside its own.
SURROUNDINGS = "surroundings.json"


class BoundingVolume(TypedDict):
    """Bounding volume of a tile: centre and half axes of a box, twelve numbers in metres."""

    box: list[float]


class TileContent(TypedDict):
    """Reference from a tile to its model or to a linked tileset."""

    uri: str


class Tile(TypedDict, total=False):
    """Tile of 3D Tiles 1.1."""

    boundingVolume: Required[BoundingVolume]
    geometricError: Required[float]
    content: TileContent
    refine: str
    children: list[Tile]
    transform: list[float]


class Tileset(TypedDict):
    """Tileset document of 3D Tiles 1.1."""

    asset: Mapping[str, object]
    geometricError: float
    root: Tile


@dataclass(frozen=True)
class TilesetSummary:
    """Summary of a written tileset.

    Attributes
    ----------
    tilesets : JSON files by path, tileset.json among them.
    page_texels : texels of all pages.
    used_texels : texels that triangles show.
    draw_calls : draw calls of all tiles.
    bytes : size of all tiles.
    """

    tilesets: Mapping[str, Tileset]
    page_texels: int
    used_texels: float
    draw_calls: int
    bytes: int


@dataclass(frozen=True)
class DetailLevel:
    """Level of detail of a leaf.

    Attributes
    ----------
    name : name in the path of its file.
    glb : the model.
    corners : (2, 3) bounds, z up.
    error : geometric error against the next finer level, metres.
    draw_calls : draw calls of the model.
    """

    name: str
    glb: bytes
    corners: Float64Array
    error: float
    draw_calls: int


# Builds the levels of detail of a leaf, coarsest first; the last has no geometric error.
MakeDetailLevels = Callable[[QuadtreeCell], Sequence[DetailLevel]]


@dataclass(frozen=True)
class TiledModel:
    """Model that a tileset shows.

    Attributes
    ----------
    source : textured mesh of the block.
    shells : shells of the buildings.
    frame : frame of the tileset.
    features : feature table of the block.
    finest : the same charts as the finest tiles show them, such as with relief; None: as in the source.
    around : objects of the street, and what lies around the block; None without.
    """

    source: TexturedMesh
    shells: BuildingShells
    frame: TilesetFrame
    features: FeatureTable
    finest: TexturedMesh | None = None
    around: SurroundingModel | None = None


@dataclass(frozen=True)
class TileSettings:
    """Settings of the tiles of a tileset.

    Attributes
    ----------
    encoder : encoder of the textures.
    scale : factor on the texels per metre of all tiles.
    time : time of day shown by emissive materials.
    levels : builds the levels of detail of a leaf, coarsest first.
    """

    encoder: TextureEncoder
    scale: float = 1.0
    time: TimeOfDay = "day"
    levels: MakeDetailLevels | None = None


class _TilesetWriter:
    def __init__(
        self, model: TiledModel, settings: TileSettings, copyright: str, write: Callable[[str, bytes], None]
    ) -> None:
        self.source, self.shells, self.frame, self.features = model.source, model.shells, model.frame, model.features
        self.encoder, self.scale, self.time, self.levels = (
            settings.encoder,
            settings.scale,
            settings.time,
            settings.levels,
        )
        self.finest = model.finest or model.source
        self.copyright, self.write = copyright, write
        self.tilesets: dict[str, Tileset] = {}
        self.page_texels, self.used_texels, self.draw_calls, self.bytes = 0, 0.0, 0, 0
        self.shell_rows = self.features.select_building_rows(
            self.shells.textured_mesh.charts.building, self.source.charts.building
        )

    def write_content(self, uri: str, parts: Sequence[tuple[TilePages, IntArray]]) -> Float64Array:
        """Write a tile from pages and the feature rows (charts, 2) of their charts; returns its bounds (2, 3), z up."""
        batches, page_textures = [], []
        for pages, rows in parts:
            batches += _page_batches(pages, rows, self.frame)
            page_textures += [
                encode_textures(pages.draw_images(page), self.encoder) for page in range(len(pages.packed.layout.pages))
            ]
            self.page_texels += pages.page_texels
            self.used_texels += pages.used_texels
        self.write_model(
            uri,
            encode_tile_glb(batches, page_textures, self.encoder, self.features, self.copyright, self.time),
            len(batches),
        )
        return z_up_bounds([batch.position for batch in batches])

    def write_model(self, uri: str, data: bytes, draws: int) -> None:
        self.draw_calls += draws
        self.bytes += len(data)
        self.write(uri, data)

    def surroundings_tile(self, uri: str, model: SurroundingModel) -> Tile:
        """Write a model of surroundings as a tile that has no other detail."""
        self.write_model(uri, encode_surroundings_glb(model, {}, self.copyright), model.draw_calls)
        box = bounding_box(z_up_bounds([model.points()]))
        return {"boundingVolume": {"box": box}, "geometricError": 0.0, "refine": "ADD", "content": {"uri": uri}}

    def full_tile(self, cell: QuadtreeCell) -> Tile:
        if self.levels is not None:
            return self.leaf_tile(cell, self.levels(cell))
        charts = cell_charts(self.source, cell)
        uri = f"tiles/full{cell.path and '-'}{cell.path}.glb"
        corners = self.write_content(uri, [(pack_tile_pages(self.finest, charts, self.scale), self.rows)])
        return {
            "boundingVolume": {"box": bounding_box(corners)},
            "geometricError": 0.0,
            "content": {"uri": f"../{uri}"},
        }

    def leaf_tile(self, cell: QuadtreeCell, levels: Sequence[DetailLevel]) -> Tile:
        """Write the levels of detail of a leaf as a chain of replacements."""
        tile: Tile | None = None
        box = bounding_box(np.concatenate([level.corners for level in levels]))
        for level in reversed(levels):
            uri = f"tiles/{level.name}{cell.path and '-'}{cell.path}.glb"
            self.write_model(uri, level.glb, level.draw_calls)
            finer = tile
            tile = {
                "boundingVolume": {"box": box},
                "geometricError": level.error,
                "content": {"uri": f"../{uri}"},
            }
            if finer is not None:
                tile |= {"refine": "REPLACE", "children": [finer]}
        assert tile is not None
        return tile

    @property
    def rows(self) -> Int64Array:
        return np.column_stack([self.features.chart_rows, self.features.owner_rows])

    def finer_tiles(self, cell: QuadtreeCell) -> list[Tile]:
        """Return the tiles that replace the coarse tile of a cell: those of the nearest finer cells below."""
        finer = [
            t for c in cell.children for t in ([self.link_tileset(c)] if c.scale > cell.scale else self.finer_tiles(c))
        ]
        return finer or [self.full_tile(cell)]

    def link_tileset(self, cell: QuadtreeCell) -> Tile:
        """Write a coarse tile with its subtree as a tileset of its own."""
        root = self.coarse_tile(cell)
        uri = f"tilesets/{cell.path}.json"
        error = root["geometricError"]
        self.tilesets[uri] = {"asset": {"version": "1.1"}, "geometricError": error, "root": root}
        return {
            "boundingVolume": root["boundingVolume"],
            "geometricError": error,
            "content": {"uri": f"../{uri}"},
        }

    def coarse_tile(self, cell: QuadtreeCell) -> Tile:
        children = self.finer_tiles(cell)
        shelled = np.setdiff1d(cell.buildings, self.shells.without_shell)
        uri = f"tiles/coarse{cell.path and '-'}{cell.path}.glb"
        simple, own = pack_coarse_pages(self.source, self.shells, cell, self.scale)
        parts = [(pages, np.column_stack([self.shell_rows] * 2)) for pages in simple] + [
            (pages, self.rows) for pages in own
        ]
        corners = [self.write_content(uri, parts), *map(box_corners, children)]
        charts = cell_charts(self.source, cell)
        density = float((self.source.texels[charts] / self.source.extent[charts]).max())
        errors = [
            ERROR_PIXELS / (density * self.scale * cell.scale),
            self.finest.max_offset_m,
            *(self.shells.deviation_m[building] for building in shelled.tolist()),
            *(child["geometricError"] for child in children),
        ]
        return {
            "boundingVolume": {"box": bounding_box(np.concatenate(corners))},
            "geometricError": max(errors),
            "refine": "REPLACE",
            "content": {"uri": f"../{uri}"},
            "children": children,
        }


def write_tileset(
    model: TiledModel,
    cells: QuadtreeCell,
    settings: TileSettings,
    write: Callable[[str, bytes], None],
    *,
    extras: Mapping[str, object],
    attribution: Attribution,
) -> TilesetSummary:
    """Write the tileset of a quadtree, one tile at a time.

    The lowest tiles show the source, or the detail levels of a leaf. The tiles above show shells, the ground and the
    buildings without a shell at a lower density. Each tile has one primitive per page. Its geometric error covers its own
    content only. Every coarse tile but the root starts a tileset of its own. Objects of the street are a tile that is
    added to all others, and neighbours a tileset of their own, as clients look at the extent of a tileset.

    Parameters
    ----------
    model : model to write.
    cells : root of the quadtree.
    settings : settings of the tiles.
    write : receives the relative path and the bytes of a file.
    extras : extras of the asset.
    attribution : attribution of the data.
    """
    writer, around = _TilesetWriter(model, settings, attribution.line, write), model.around
    tiles, facts = [_move_up(writer.coarse_tile(cells))], {**extras, "attribution": attribution.to_json()}
    if around is not None and len(around.around):
        tile = writer.surroundings_tile("surroundings.glb", around.neighbours_alone)
        writer.tilesets[SURROUNDINGS] = _build_tileset([tile], model.frame, facts)
        facts = {**facts, "surroundings": SURROUNDINGS}
    if around is not None and len(around.placed):
        tiles.append(writer.surroundings_tile("tiles/objects.glb", around.objects_alone))
    return TilesetSummary(
        {"tileset.json": _build_tileset(tiles, model.frame, facts), **writer.tilesets},
        writer.page_texels,
        writer.used_texels,
        writer.draw_calls,
        writer.bytes,
    )


def _build_tileset(tiles: Sequence[Tile], frame: TilesetFrame, extras: Mapping[str, object]) -> Tileset:
    """Return the document of tiles that are shown together, or of one tile as its root."""
    box = bounding_box(np.concatenate([box_corners(tile) for tile in tiles]))
    reach = 2 * float(np.linalg.norm(np.array(box)[[3, 7, 11]]))
    error = max(reach, *(2 * tile["geometricError"] for tile in tiles))
    # a root without content has the error of its tileset, so that both are shown from the same distance
    joined: Tile = {"boundingVolume": {"box": box}, "geometricError": error, "refine": "ADD", "children": [*tiles]}
    root: Tile = joined if len(tiles) > 1 else {**tiles[0]}
    root["transform"] = frame.transform().T.reshape(-1).tolist()
    return {"asset": {"version": "1.1", "extras": extras}, "geometricError": error, "root": root}


def count_tiles(cell: QuadtreeCell, levels: int = 1, above: float = 0.0) -> int:
    """Count the tiles that `write_tileset` writes below a tile of scale `above`, with `levels` per leaf."""
    return (cell.scale > above) + (sum(count_tiles(child, levels, cell.scale) for child in cell.children) or levels)


def z_up_bounds(positions: Sequence[Float64Array]) -> Float64Array:
    """Return the z-up bounds (2, 3) of points (n, 3) given in glTF's y-up frame."""
    points = np.concatenate(positions)
    return np.sort(np.stack([points.min(axis=0), points.max(axis=0)])[:, [0, 2, 1]] * [1, -1, 1], axis=0)


def view_texture_scale(
    source: TexturedMesh,
    shells: BuildingShells,
    cells: QuadtreeCell,
    encoder: TextureEncoder,
    max_bytes: float,
    time: TimeOfDay = "day",
) -> float:
    """Compute the largest scale up to 1 at which the textures of any view fit the graphics memory.

    A view holds the finest tiles within `view_radius_m` of the centre of a leaf, and the coarse tiles above them.

    Parameters
    ----------
    source : textured mesh of the block.
    shells : shells of the buildings.
    cells : root of the quadtree.
    encoder : encoder of the textures.
    max_bytes : limit of graphics memory, bytes.
    time : time of day shown by emissive materials.
    """
    leaves = list(cells.leaves())
    middle = np.array([source.centres[cell_charts(source, leaf), :2].mean(axis=0) for leaf in leaves])
    near = np.linalg.norm(middle[:, None] - middle[None], axis=-1) <= TEXTURE_BUDGET.view_radius_m
    coarse = list(_iterate_coarse_cells(cells))
    # the path of a leaf starts with the paths of the cells above it; (views, coarse tiles)
    above = near @ np.array([[leaf.path.startswith(cell.path) for cell in coarse] for leaf in leaves])
    texel_bytes = encoder.bytes_per_texel * MIPMAP_FACTOR * material_texel_ratio(source.maps is not None, time)
    scale = 1.0
    while True:
        fine = np.array([pack_tile_pages(source, cell_charts(source, leaf), scale).page_texels for leaf in leaves])
        more = [_coarse_texels(source, shells, cell, scale) for cell in coarse]
        held = float((near @ fine + above @ np.array(more)).max()) * texel_bytes
        if held <= max_bytes or scale < TILE_CELLS.coarse_scale:
            return scale
        scale *= max(TILE_CELLS.coarse_scale, min(TEXTURE_BUDGET.max_scale_step, float(np.sqrt(max_bytes / held))))


def _coarse_texels(source: TexturedMesh, shells: BuildingShells, cell: QuadtreeCell, scale: float) -> int:
    return sum(pages.page_texels for part in pack_coarse_pages(source, shells, cell, scale) for pages in part)


def pack_coarse_pages(
    source: TexturedMesh, shells: BuildingShells, cell: QuadtreeCell, scale: float
) -> tuple[Sequence[TilePages], Sequence[TilePages]]:
    """Pack the coarse tile of a cell.

    Returns
    -------
    Pages of shells and pages of the source, each possibly empty.
    """
    kept = np.intersect1d(cell.buildings, shells.without_shell)
    own = np.union1d(cell.ground, source.select_charts(kept)).astype(np.int64)
    simple = shells.textured_mesh.select_charts(np.setdiff1d(cell.buildings, kept))
    # rasters of shells already have `coarse_scale`
    return (
        [pack_tile_pages(shells.textured_mesh, simple, scale * cell.scale / TILE_CELLS.coarse_scale)]
        if len(simple)
        else [],
        [pack_tile_pages(source, own, scale * cell.scale)] if len(own) else [],
    )


def _iterate_coarse_cells(cell: QuadtreeCell, above: float = 0.0) -> Iterator[QuadtreeCell]:
    """Iterate over the cells with a coarse tile, below one of scale `above`."""
    if cell.scale > above:
        yield cell
    for child in cell.children:
        yield from _iterate_coarse_cells(child, cell.scale)


def cell_charts(source: TexturedMesh, cell: QuadtreeCell) -> Int64Array:
    """Return the charts (k,) of a cell, ascending."""
    return np.union1d(cell.ground, source.select_charts(cell.buildings)).astype(np.int64)


def _page_batches(pages: TilePages, rows: IntArray, frame: TilesetFrame) -> list[TileBatch]:
    """Return one batch per page."""
    drawn = pages.packed
    source, mesh = drawn.source, drawn.source.mesh
    place = np.full(len(source.charts), -1, np.int64)
    place[drawn.charts] = np.arange(len(drawn.charts))
    mine = np.flatnonzero(place[mesh.chart] >= 0)
    found = []
    for _, here in sorted(group_rows(drawn.layout.page[place[mesh.chart[mine]]]).items()):
        used, index = np.unique(mesh.triangles[mine[here]], return_inverse=True)
        chart = mesh.vertex_chart[used]
        found.append(
            TileBatch(
                frame.points(mesh.vertices[used]),
                frame.directions(source.normals[used]),
                drawn.texture_coordinates(chart, source.coordinates[used]),
                index.reshape(-1, 3),
                rows[chart],
                turn_tangents(source.tangents[used], frame) if source.maps else None,
            )
        )
    return found


def _move_up(tile: Tile) -> Tile:
    """Rewrite the URIs of a tile for the parent folder."""
    moved: Tile = {**tile, "content": {"uri": tile["content"]["uri"].removeprefix("../")}}
    # children in the same file move too; linked tilesets do not
    if "children" in tile:
        moved["children"] = [_move_up(child) for child in tile["children"]]
    return moved


def bounding_box(points: Float64Array) -> list[float]:
    """Return centre and half axes around points (n, 3), z up, with a minimum thickness."""
    low, high = points.min(axis=0), points.max(axis=0)
    half = np.maximum((high - low) / 2, 0.01)
    box: list[float] = np.concatenate([(low + high) / 2, np.diag(half).reshape(-1)]).tolist()
    return box


def box_corners(tile: Tile) -> Float64Array:
    box = np.array(tile["boundingVolume"]["box"])
    half = box[[3, 7, 11]]
    return np.stack([box[:3] - half, box[:3] + half])
