"""Overview of a block as one small model with coarse textures, and of very many charts the largest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from facade_core.core.arrays import Int64Array
from facade_core.export.models.glb import encode_glb
from facade_core.export.models.pages import GUTTER_TEXELS
from facade_core.export.models.textured_mesh import (
    TexturedMesh,
    YUpFrame,
    build_nodes,
    encode_pages,
    pack_charts_on_pages,
)

# Maximum size of an overview, bytes.
MAX_OVERVIEW_BYTES = 8_000_000
# Share of the size that geometry may take.
MAX_GEOMETRY_SHARE = 0.5
# Size of a vertex with normal and texture coordinates, bytes.
VERTEX_BYTES = 32
# Size of a triangle, bytes.
TRIANGLE_BYTES = 12
# Size of an encoded pixel of coarse textures, bytes.
PIXEL_BYTES = 0.15
OVERVIEW_NODE = "overview"


def select_overview_charts(source: TexturedMesh) -> Int64Array:
    """Select the largest charts whose geometry fits an overview, ascending."""
    mesh, count = source.mesh, len(source.charts)
    vertices = np.bincount(mesh.vertex_chart[np.unique(mesh.triangles)], minlength=count)
    triangles = np.bincount(mesh.chart, minlength=count)
    drawn = np.flatnonzero(triangles)
    order = drawn[np.argsort(-source.charts.size[drawn].prod(axis=1), kind="stable")]
    takes = np.cumsum(VERTEX_BYTES * vertices[order] + TRIANGLE_BYTES * triangles[order])
    return np.sort(order[takes <= MAX_GEOMETRY_SHARE * MAX_OVERVIEW_BYTES])


def overview_scale(texels: Int64Array) -> float:
    """Compute the scale, a power of two up to 1, at which rasters fit an overview.

    Parameters
    ----------
    texels : (n, 2) width and height of the rasters.
    """
    scale = 1.0
    while scale * texels.max(initial=1) > 1:
        size = np.ceil(texels * scale)
        padded = np.ceil((size + 2 * GUTTER_TEXELS) / GUTTER_TEXELS) * GUTTER_TEXELS
        if padded.prod(axis=1).sum() * PIXEL_BYTES <= (1 - MAX_GEOMETRY_SHARE) * MAX_OVERVIEW_BYTES:
            break
        scale /= 2
    return scale


def encode_overview(
    source: TexturedMesh, charts: Int64Array, extras: Mapping[str, object], *, copyright: str = ""
) -> bytes:
    """Encode charts as one node, of at most MAX_OVERVIEW_BYTES.

    Textures are halved until the model fits; after that, charts are dropped.

    Parameters
    ----------
    source : mesh with coarse rasters.
    charts : (k,) chart ids, ascending.
    extras : extras of the scene; `origin` in world metres is the origin of the model.
    copyright : attribution.
    """
    whole = replace(source, charts=replace(source.charts, building=np.zeros_like(source.charts.building)))
    frame = YUpFrame(np.array(extras["origin"], float))
    scale = 1.0
    while True:
        drawn = pack_charts_on_pages(whole, charts, scale)
        data = encode_glb(
            build_nodes([drawn], {0: OVERVIEW_NODE}, frame)[0], encode_pages(drawn), extras=extras, copyright=copyright
        )
        if len(data) <= MAX_OVERVIEW_BYTES or not len(charts):
            return data
        if scale * source.texels[charts].max() > 1:
            scale /= 2
        else:
            order = charts[np.argsort(-source.charts.size[charts].prod(axis=1), kind="stable")]
            charts = np.sort(order[: len(order) // 2])
