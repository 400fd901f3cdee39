"""Leaves of a tileset as factored models at two levels of detail; their textures are shared files next to the tiles."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from facade_core.core.arrays import Int64Array, UInt8Array
from facade_core.core.grouping import RowsByValue
from facade_core.export.bodies.settings import ELEMENT_DEPTHS
from facade_core.export.factored.glb import FactoredPrimitive, encode_factored_glb
from facade_core.export.factored.parts import (
    build_factored_primitives,
    merge_factored_primitives,
    merge_pieces,
    pack_unfactored_charts,
)
from facade_core.export.factored.settings import FACTORED_WALLS
from facade_core.export.factored.texture_packing import PackedTextures, texture_memory_bytes
from facade_core.export.factored.wall_geometry import WallPieces
from facade_core.export.models.encoders import TextureEncoder
from facade_core.export.models.features import FeatureTable
from facade_core.export.models.textured_mesh import ModelFrame, TexturedMesh
from facade_core.export.tiles.cells import QuadtreeCell
from facade_core.export.tiles.tileset import ERROR_PIXELS, DetailLevel, cell_charts, z_up_bounds


@dataclass(eq=False)
class FactoredLeafBuilder:
    """Builder of a block's factored leaves, with their shared textures and counts.

    Attributes
    ----------
    levels : wall pieces by level name and building, coarsest first.
    pictures : textures of all walls.
    picture_names : files of the textures.
    source : textured mesh of the block.
    unfactored_charts : charts that are not factored.
    frame : frame of the tileset.
    features : feature table of the block.
    encoder : encoder of the textures.
    copyright : attribution.
    write : receives the path, relative to the tileset, and the bytes of a file.
    texture_bytes : graphics memory of the unfactored pages so far.
    triangles : triangles of the finest levels so far.
    """

    levels: Mapping[str, Mapping[int, WallPieces]]
    pictures: PackedTextures
    picture_names: Sequence[str]
    source: TexturedMesh
    unfactored_charts: Int64Array
    frame: ModelFrame
    features: FeatureTable
    encoder: TextureEncoder
    copyright: str
    write: Callable[[str, bytes], None]
    texture_bytes: float = 0.0
    triangles: int = 0
    triangles_of: RowsByValue = field(init=False)

    def __post_init__(self) -> None:
        self.triangles_of = RowsByValue(self.source.mesh.chart)

    def build_detail_levels(self, cell: QuadtreeCell) -> list[DetailLevel]:
        """Build the levels of detail of a cell, coarsest first; one if nothing is factored."""
        mine = np.intersect1d(cell_charts(self.source, cell), self.unfactored_charts)
        before = len(self.picture_names)
        pages, parts = pack_unfactored_charts(self.source, self.triangles_of, mine, before, self.frame)
        self.texture_bytes += texture_memory_bytes(pages)
        uris = [f"../{name}" for name in (*self.picture_names, *self.write_pages(cell, pages))]
        repeated = [*self.pictures.is_repeated, *[False] * len(pages)]
        found = []
        levels = list(self.levels.items())[-1 if self.is_unfactored(cell) else 0 :]
        for number, (level, laid) in enumerate(levels):
            shown = merge_factored_primitives([self.build_walls(cell, laid), *parts.values()])
            glb = encode_factored_glb(
                {cell.path or "block": shown},
                uris,
                repeated,
                self.encoder,
                self.features,
                extras={},
                copyright=self.copyright,
            )
            last = number == len(levels) - 1
            if last:
                self.triangles += sum(len(part.triangles) for part in shown.values())
            bounds = z_up_bounds([part.position for part in shown.values()])
            found.append(DetailLevel(level, glb, bounds, 0.0 if last else _recess_error(), len(shown)))
        return found

    def build_walls(self, cell: QuadtreeCell, laid: Mapping[int, WallPieces]) -> dict[int, FactoredPrimitive]:
        """Build the walls of a cell's buildings by texture."""
        own = merge_pieces(laid[building] for building in cell.buildings.tolist() if building in laid)
        return build_factored_primitives(own, self.pictures, self.frame)

    def write_pages(self, cell: QuadtreeCell, pages: Sequence[UInt8Array]) -> list[str]:
        """Write the pages of a cell's unfactored charts and return their files, relative to the tileset."""
        names = [f"pictures/rest{cell.path and '-'}{cell.path}-{k}.jpg" for k in range(len(pages))]
        for name, page in zip(names, pages, strict=True):
            self.write(name, self.encoder.encode(page))
        return names

    def is_unfactored(self, cell: QuadtreeCell) -> bool:
        """Return True if no building of a cell is factored."""
        return not any(building in laid for laid in self.levels.values() for building in cell.buildings.tolist())


def _recess_error() -> float:
    """Return the geometric error, metres, of a level without recesses."""
    return -ELEMENT_DEPTHS["window"] * ERROR_PIXELS / FACTORED_WALLS.min_recess_pixels
