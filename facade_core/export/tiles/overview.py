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
from facade_core.export.tiles.settings import OVERVIEW_MODEL, OverviewSettings

OVERVIEW_NODE = "overview"


def select_overview_charts(source: TexturedMesh, settings: OverviewSettings = OVERVIEW_MODEL) -> Int64Array:
    """Select the largest charts whose geometry fits an overview, ascending."""
    mesh, count = source.mesh, len(source.charts)
    vertices = np.bincount(mesh.vertex_chart[np.unique(mesh.triangles)], minlength=count)
    triangles = np.bincount(mesh.chart, minlength=count)
    drawn = np.flatnonzero(triangles)
    order = drawn[np.argsort(-source.charts.size[drawn].prod(axis=1), kind="stable")]
    takes = np.cumsum(settings.vertex_bytes * vertices[order] + settings.triangle_bytes * triangles[order])
    return np.sort(order[takes <= settings.max_geometry_share * settings.max_overview_bytes])


def overview_scale(texels: Int64Array, settings: OverviewSettings = OVERVIEW_MODEL) -> float:
    """Compute the scale, a power of two up to 1, at which rasters fit an overview.

    Parameters
    ----------
    texels : (n, 2) width and height of the rasters.
    settings : numbers of the overview.
    """
    scale = 1.0
    while scale * texels.max(initial=1) > 1:
        size = np.ceil(texels * scale)
        padded = np.ceil((size + 2 * GUTTER_TEXELS) / GUTTER_TEXELS) * GUTTER_TEXELS
        if (
            padded.prod(axis=1).sum() * settings.pixel_bytes
            <= (1 - settings.max_geometry_share) * settings.max_overview_bytes
        ):
            break
        scale /= 2
    return scale


def encode_overview(
    source: TexturedMesh,
    charts: Int64Array,
    extras: Mapping[str, object],
    *,
    copyright: str = "",
    settings: OverviewSettings = OVERVIEW_MODEL,
) -> bytes:
    """Encode charts as one node, of at most `max_overview_bytes`.

    Textures are halved until the model fits; after that, charts are dropped.

    Parameters
    ----------
    source : mesh with coarse rasters.
    charts : (k,) chart ids, ascending.
    extras : extras of the scene; `origin` in world metres is the origin of the model.
    copyright : attribution.
    settings : numbers of the overview.
    """
    whole = replace(source, charts=replace(source.charts, building=np.zeros_like(source.charts.building)))
    frame = YUpFrame(np.array(extras["origin"], float))
    scale = 1.0
    while True:
        drawn = pack_charts_on_pages(whole, charts, scale)
        data = encode_glb(
            build_nodes([drawn], {0: OVERVIEW_NODE}, frame)[0], encode_pages(drawn), extras=extras, copyright=copyright
        )
        if len(data) <= settings.max_overview_bytes or not len(charts):
            return data
        if scale * source.texels[charts].max() > 1:
            scale /= 2
        else:
            order = charts[np.argsort(-source.charts.size[charts].prod(axis=1), kind="stable")]
            charts = np.sort(order[: len(order) // 2])
