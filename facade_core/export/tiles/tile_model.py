"""The model of a tile: some charts of a block with pictures of their own, made a picture at a time. A picture of which no chart
changed is taken from the model of before."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from facade_core.atlas.journal import unit_key
from facade_core.export.models.glb import embedded_images, encode_glb
from facade_core.export.models.pages import downscale
from facade_core.export.models.textured_mesh import LocalFrame, TexturedMesh, build_nodes, encode_page, pack_charts

# Coarse rasters have one of so many texels along each side.
COARSE_DIVISOR = 4
# The rasters (h, w, 3) uint8 of some charts (k,), by chart.
ReadRasters = Callable[[np.ndarray], Mapping[int, np.ndarray]]


@dataclass(frozen=True)
class TileModel:
    """A tile: its GLB; the least and greatest corner (2, 3) of what it shows, world metres; the rasters of its charts made
    COARSER, (texels, 3) uint8, one after the other; what each of its pictures is made of, as a digest."""

    glb: bytes
    box: np.ndarray
    coarse: np.ndarray
    picture_digests: tuple[str, ...]


@dataclass(frozen=True)
class EarlierTile:
    """A tile of the same charts, of as many texels, as it was before."""

    glb: bytes
    coarse: np.ndarray
    picture_digests: tuple[str, ...]


def build_tile_model(
    source: TexturedMesh,
    charts: np.ndarray,
    digests: Sequence[str | None],
    names: Mapping[int, str],
    read_rasters: ReadRasters,
    extras: Mapping[str, Any],
    earlier: EarlierTile | None = None,
) -> TileModel:
    """A tile of some charts (k,), ascending, which have triangles; its frame is around `extras["origin"]`, world metres.

    digests: of the rasters of its charts (k,). names: building -> the name of its node. `read` is asked for the charts of one
    picture at a time, for none of a picture that the `earlier` tile has.
    """
    drawn = pack_charts(source, charts)
    size = coarse_size(source.texels[charts])
    start = np.cumsum(size.prod(axis=1)) - size.prod(axis=1)
    coarse = earlier.coarse.copy() if earlier else np.zeros((int(size.prod(axis=1).sum()), 3), np.uint8)
    pictures, picture_digests = [], []
    for page in range(len(drawn.layout.pages)):
        here = np.flatnonzero(drawn.layout.page == page)
        picture_digests.append(unit_key([digests[i] for i in here.tolist()]))
        if earlier and earlier.picture_digests[page] == picture_digests[page]:
            pictures.append(embedded_images(earlier.glb)[page])
            continue
        rasters = read_rasters(charts[here])
        pictures.append(encode_page(replace(drawn, source=replace(source, raster=rasters.__getitem__)), page))
        for i in here.tolist():
            width, height = size[i].tolist()
            small = downscale(rasters[int(charts[i])], (width, height))
            coarse[start[i] : start[i] + width * height] = small.reshape(-1, 3)
    origin = np.array(extras["origin"], float)
    nodes, bounds = build_nodes([drawn], names, LocalFrame(origin))
    corners = bounds[:, [0, 2, 1]] * [1, -1, 1] + origin
    return TileModel(
        encode_glb(nodes, pictures, extras=extras), np.sort(corners, axis=0), coarse, tuple(picture_digests)
    )


def coarse_size(texels: np.ndarray) -> np.ndarray:
    """Width and height (n, 2) of coarse rasters of charts of so many texels (n, 2)."""
    return -(-texels // COARSE_DIVISOR)


def coarse_rasters(texels: np.ndarray, charts: np.ndarray, coarse: np.ndarray) -> dict[int, np.ndarray]:
    """The coarse rasters (h, w, 3) of a tile's charts, by chart; texels (charts,) of every chart of the block."""
    size = coarse_size(texels[charts])
    parts = np.split(coarse, np.cumsum(size.prod(axis=1))[:-1])
    return {
        chart: part.reshape(height, width, 3)
        for chart, part, (width, height) in zip(charts.tolist(), parts, size.tolist(), strict=True)
    }
