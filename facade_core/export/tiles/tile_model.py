"""The model of a tile: some charts of a block with pictures of their own, made a picture at a time. A picture of which no chart
changed is taken from the model of before."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from facade_core.atlas.journal import unit_key
from facade_core.export.models.glb import glb_bytes, pictures_of
from facade_core.export.models.pages import scaled
from facade_core.export.models.textured_mesh import LocalFrame, Textured, layout_of, nodes_of, page_jpeg

# Coarse rasters have one of so many texels along each side.
COARSER = 4
# The rasters (h, w, 3) uint8 of some charts (k,), by chart.
ReadRasters = Callable[[np.ndarray], Mapping[int, np.ndarray]]


@dataclass(frozen=True)
class TileModel:
    """A tile: its GLB; the least and greatest corner (2, 3) of what it shows, world metres; the rasters of its charts made
    COARSER, (texels, 3) uint8, one after the other; what each of its pictures is made of, as a digest."""

    glb: bytes
    box: np.ndarray
    coarse: np.ndarray
    made_of: tuple[str, ...]


@dataclass(frozen=True)
class Earlier:
    """A tile of the same charts, of as many texels, as it was before."""

    glb: bytes
    coarse: np.ndarray
    made_of: tuple[str, ...]


def tile_model(
    source: Textured,
    charts: np.ndarray,
    digests: Sequence[str | None],
    names: Mapping[int, str],
    read: ReadRasters,
    extras: Mapping[str, Any],
    earlier: Earlier | None = None,
) -> TileModel:
    """A tile of some charts (k,), ascending, which have triangles; its frame is around `extras["origin"]`, world metres.

    digests: of the rasters of its charts (k,). names: building -> the name of its node. `read` is asked for the charts of one
    picture at a time, for none of a picture that the `earlier` tile has.
    """
    drawn = layout_of(source, charts)
    size = coarse_size(source.texels[charts])
    start = np.cumsum(size.prod(axis=1)) - size.prod(axis=1)
    coarse = earlier.coarse.copy() if earlier else np.zeros((int(size.prod(axis=1).sum()), 3), np.uint8)
    pictures, made_of = [], []
    for page in range(len(drawn.layout.pages)):
        here = np.flatnonzero(drawn.layout.page == page)
        made_of.append(unit_key([digests[i] for i in here.tolist()]))
        if earlier and earlier.made_of[page] == made_of[page]:
            pictures.append(pictures_of(earlier.glb)[page])
            continue
        rasters = read(charts[here])
        pictures.append(page_jpeg(replace(drawn, source=replace(source, raster=rasters.__getitem__)), page))
        for i in here.tolist():
            width, height = size[i].tolist()
            small = scaled(rasters[int(charts[i])], (width, height))
            coarse[start[i] : start[i] + width * height] = small.reshape(-1, 3)
    origin = np.array(extras["origin"], float)
    nodes, bounds = nodes_of([drawn], names, LocalFrame(origin))
    corners = bounds[:, [0, 2, 1]] * [1, -1, 1] + origin
    return TileModel(glb_bytes(nodes, pictures, extras=extras), np.sort(corners, axis=0), coarse, tuple(made_of))


def coarse_size(texels: np.ndarray) -> np.ndarray:
    """Width and height (n, 2) of coarse rasters of charts of so many texels (n, 2)."""
    return -(-texels // COARSER)


def coarse_rasters(texels: np.ndarray, charts: np.ndarray, coarse: np.ndarray) -> dict[int, np.ndarray]:
    """The coarse rasters (h, w, 3) of a tile's charts, by chart; texels (charts,) of every chart of the block."""
    size = coarse_size(texels[charts])
    parts = np.split(coarse, np.cumsum(size.prod(axis=1))[:-1])
    return {
        chart: part.reshape(height, width, 3)
        for chart, part, (width, height) in zip(charts.tolist(), parts, size.tolist(), strict=True)
    }
