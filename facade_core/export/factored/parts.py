"""Parts of a factored model: walls by texture, and pages of the unfactored charts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from facade_core.core.arrays import Float64Array, FloatArray, Int64Array, UInt8Array
from facade_core.core.grouping import RowsByValue, group_rows
from facade_core.export.factored.glb import FactoredPrimitive
from facade_core.export.factored.settings import UNFACTORED
from facade_core.export.factored.texture_packing import PackedTextures
from facade_core.export.factored.wall_geometry import WallPiece, WallPieces
from facade_core.export.models.pages import downscale
from facade_core.export.models.textured_mesh import ModelFrame, TexturedMesh
from facade_core.export.tiles.tile_pages import pack_tile_pages
from facade_core.geometry.charts import ChartKind


def merge_pieces(every: Iterable[WallPieces]) -> WallPieces:
    """Merge the pieces of several buildings by picture."""
    whole = WallPieces()
    for pieces in every:
        for key, own in pieces.by_picture.items():
            whole.by_picture.setdefault(key, []).extend(own)
        whole.elements.extend(pieces.elements)
    return whole


def build_factored_primitives(
    pieces: WallPieces, pictures: PackedTextures, frame: ModelFrame
) -> dict[int, FactoredPrimitive]:
    """Build the parts of wall pieces by texture."""
    by_texture: dict[int, list[tuple[WallPiece, Float64Array, FloatArray]]] = {}
    for key, own in sorted(pieces.by_picture.items()):
        for piece in own:
            texture, uv, colour = pictures.texture_lookup(key, piece)
            by_texture.setdefault(texture, []).append((piece, uv, colour))
    return {texture: _make_part(own, frame) for texture, own in by_texture.items()}


def merge_factored_primitives(every: Iterable[Mapping[int, FactoredPrimitive]]) -> dict[int, FactoredPrimitive]:
    """Merge the parts of several buildings by texture."""
    of: dict[int, list[FactoredPrimitive]] = {}
    for parts in every:
        for texture, part in parts.items():
            of.setdefault(texture, []).append(part)
    return {texture: _concatenate_parts(own) for texture, own in sorted(of.items())}


def _concatenate_parts(own: Sequence[FactoredPrimitive]) -> FactoredPrimitive:
    first = np.concatenate([[0], np.cumsum([len(part.position) for part in own])[:-1]])
    return FactoredPrimitive(
        np.concatenate([part.position for part in own]),
        np.concatenate([part.normal for part in own]),
        np.concatenate([part.uv for part in own]),
        np.concatenate([part.colour for part in own]),
        np.concatenate([part.triangles + start for part, start in zip(own, first.tolist(), strict=True)]),
        np.concatenate([part.chart for part in own]),
    )


def _make_part(own: Sequence[tuple[WallPiece, Float64Array, FloatArray]], frame: ModelFrame) -> FactoredPrimitive:
    """Build a part of wall pieces with their texture coordinates and colours."""
    pieces = [piece for piece, _, _ in own]
    count = [len(piece.position) for piece in pieces]
    first = np.concatenate([[0], np.cumsum(count)])
    return FactoredPrimitive(
        frame.points(np.concatenate([piece.position for piece in pieces])),
        frame.directions(np.concatenate([piece.normal for piece in pieces])),
        np.concatenate([uv for _, uv, _ in own]),
        np.concatenate([colour for _, _, colour in own]),
        np.concatenate([piece.triangles + start for piece, start in zip(pieces, first[:-1], strict=True)]),
        np.concatenate([np.full(n, piece.chart) for n, piece in zip(count, pieces, strict=True)]),
    )


def pack_unfactored_charts(
    source: TexturedMesh, triangles_of: RowsByValue, charts: Int64Array, before: int, frame: ModelFrame
) -> tuple[list[UInt8Array], dict[int, dict[int, FactoredPrimitive]]]:
    """Pack the charts that are not factored on pages of their own.

    Parameters
    ----------
    source : textured mesh of the block.
    triangles_of : triangles of the mesh by chart.
    charts : (k,) chart ids, ascending.
    before : number of pictures before these pages.
    frame : frame of the model.

    Returns
    -------
    The pages, and their parts by building and texture.
    """
    kind = source.charts.kind
    density = (source.texels / source.extent).max(axis=1)
    share, most = np.where(
        (kind == ChartKind.GROUND)[:, None],
        (UNFACTORED.ground_share, UNFACTORED.max_ground_density),
        (UNFACTORED.unfactored_share, UNFACTORED.max_unfactored_density),
    ).T
    most = np.clip(share * density, UNFACTORED.min_density, most)
    share = np.where(np.isin(kind, (ChartKind.WINDOW, ChartKind.DOOR)), 1.0, np.minimum(1.0, most / density))
    texels = np.maximum(1, np.ceil(source.texels * share[:, None] - 1e-6)).astype(np.int64)

    def raster(chart: int) -> UInt8Array:
        width, height = texels[chart].tolist()
        return downscale(source.raster(chart), (width, height))

    pages = pack_tile_pages(replace(source, texels=texels, raster=raster), charts)
    drawn, mesh = pages.packed, source.mesh
    place = np.full(len(source.charts), -1, np.int64)
    place[charts] = np.arange(len(charts))
    mine = triangles_of.rows_with_any(charts)
    page = drawn.layout.page[place[mesh.chart[mine]]]
    owner = source.charts.building[mesh.chart[mine]].astype(np.int64)
    count = len(drawn.layout.pages)
    parts: dict[int, dict[int, FactoredPrimitive]] = {}
    for code, here in sorted(group_rows((owner + 1) * count + page).items()):
        used, index = np.unique(mesh.triangles[mine[here]], return_inverse=True)
        chart = mesh.vertex_chart[used]
        parts.setdefault(int(code // count - 1), {})[before + int(code % count)] = FactoredPrimitive(
            frame.points(mesh.vertices[used]),
            frame.directions(source.normals[used]),
            drawn.texture_coordinates(chart, source.coordinates[used]),
            np.ones((len(used), 3)),
            index.reshape(-1, 3),
            chart,
        )
    return [pages.draw_images(page).base_colour for page in range(count)], parts
