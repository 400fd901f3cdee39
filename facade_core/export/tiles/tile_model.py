"""GLB model of a tile with textures of its own, built page by page; unchanged pages are copied from the earlier model."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from facade_core.atlas.journal import unit_key
from facade_core.core.arrays import Float64Array, Int64Array, UInt8Array
from facade_core.export.models.glb import encode_glb, extract_images
from facade_core.export.models.pages import downscale
from facade_core.export.models.textured_mesh import (
    TexturedMesh,
    YUpFrame,
    build_nodes,
    encode_page,
    pack_charts_on_pages,
)

# Coarse rasters have one of so many texels along each side.
COARSE_DIVISOR = 4
# The rasters (h, w, 3) uint8 of some charts (k,), by chart.
ReadRasters = Callable[[Int64Array], Mapping[int, UInt8Array]]


@dataclass(frozen=True)
class TileModel:
    """GLB model of a tile with its bounds, coarse rasters and page digests.

    Attributes
    ----------
    glb : the model.
    box : (2, 3) bounds, world metres.
    coarse : (texels, 3) uint8 rasters of its charts, downscaled and concatenated.
    picture_digests : digest of the content of each texture page.
    """

    glb: bytes
    box: Float64Array
    coarse: UInt8Array
    picture_digests: tuple[str, ...]


@dataclass(frozen=True)
class EarlierTile:
    """Earlier version of a tile with the same charts and texels."""

    glb: bytes
    coarse: UInt8Array
    picture_digests: tuple[str, ...]


def build_tile_model(
    source: TexturedMesh,
    charts: Int64Array,
    digests: Sequence[str | None],
    names: Mapping[int, str],
    read_rasters: ReadRasters,
    extras: Mapping[str, object],
    earlier: EarlierTile | None = None,
) -> TileModel:
    """Build a tile of some charts.

    Parameters
    ----------
    source : mesh of the block.
    charts : (k,) chart ids with triangles, ascending.
    digests : (k,) digests of the charts' rasters.
    names : name of each building's node.
    read_rasters : reads the rasters of the charts of one page; not called for pages copied from `earlier`.
    extras : extras of the scene; `origin` in world metres is the origin of the model.
    earlier : the tile before.
    """
    drawn = pack_charts_on_pages(source, charts)
    size = coarse_size(source.texels[charts])
    start = np.cumsum(size.prod(axis=1)) - size.prod(axis=1)
    coarse = earlier.coarse.copy() if earlier else np.zeros((int(size.prod(axis=1).sum()), 3), np.uint8)
    pictures, picture_digests = [], []
    for page in range(len(drawn.layout.pages)):
        here = np.flatnonzero(drawn.layout.page == page)
        picture_digests.append(unit_key([digests[i] for i in here.tolist()]))
        if earlier and earlier.picture_digests[page] == picture_digests[page]:
            pictures.append(extract_images(earlier.glb)[page])
            continue
        rasters = read_rasters(charts[here])
        pictures.append(encode_page(replace(drawn, source=replace(source, raster=rasters.__getitem__)), page))
        for i in here.tolist():
            width, height = size[i].tolist()
            small = downscale(rasters[int(charts[i])], (width, height))
            coarse[start[i] : start[i] + width * height] = small.reshape(-1, 3)
    origin = np.array(extras["origin"], float)
    nodes, bounds = build_nodes([drawn], names, YUpFrame(origin))
    corners = bounds[:, [0, 2, 1]] * [1, -1, 1] + origin
    return TileModel(
        encode_glb(nodes, pictures, extras=extras), np.sort(corners, axis=0), coarse, tuple(picture_digests)
    )


def coarse_size(texels: Int64Array) -> Int64Array:
    """Return the size (n, 2) of coarse rasters of charts with `texels` (n, 2)."""
    return -(-texels // COARSE_DIVISOR)


def coarse_rasters(texels: Int64Array, charts: Int64Array, coarse: UInt8Array) -> dict[int, UInt8Array]:
    """Split the coarse texels of a tile by chart.

    Parameters
    ----------
    texels : (charts, 2) width and height of every chart of the block.
    charts : (k,) charts of the tile.
    coarse : (texels, 3) coarse texels of the tile.

    Returns
    -------
    Raster (h, w, 3) by chart.
    """
    size = coarse_size(texels[charts])
    parts = np.split(coarse, np.cumsum(size.prod(axis=1))[:-1])
    return {
        chart: part.reshape(height, width, 3)
        for chart, part, (width, height) in zip(charts.tolist(), parts, size.tolist(), strict=True)
    }
