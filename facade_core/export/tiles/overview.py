"""A block as one small model, however large it is: coarse pictures, and of very many charts the largest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from facade_core.export.models.glb import glb_bytes
from facade_core.export.models.pages import GUTTER
from facade_core.export.models.textured_mesh import LocalFrame, Textured, jpegs, layout_of, nodes_of

# What it takes at most, and the share of that which geometry may have.
OVERVIEW_BYTES, GEOMETRY = 8_000_000, 0.5
# A vertex with its normal and place on a picture, and a triangle, as bytes; an encoded pixel of coarse pictures.
VERTEX_BYTES, TRIANGLE_BYTES, PIXEL_BYTES = 32, 12, 0.15
NODE = "overview"


def shown_afar(source: Textured) -> np.ndarray:
    """The charts (k,) of an overview, ascending: all that have triangles, or as many of the largest as its geometry has room
    for."""
    mesh, count = source.mesh, len(source.charts)
    vertices = np.bincount(mesh.vertex_chart[np.unique(mesh.triangles)], minlength=count)
    triangles = np.bincount(mesh.chart, minlength=count)
    drawn = np.flatnonzero(triangles)
    order = drawn[np.argsort(-source.charts.size[drawn].prod(axis=1), kind="stable")]
    takes = np.cumsum(VERTEX_BYTES * vertices[order] + TRIANGLE_BYTES * triangles[order])
    return np.sort(order[takes <= GEOMETRY * OVERVIEW_BYTES])


def scale_afar(texels: np.ndarray) -> float:
    """The scale, 1 or halved as often as needed, at which rasters of so many texels (n, 2) fit an overview's pictures."""
    scale = 1.0
    while scale * texels.max(initial=1) > 1:
        size = np.ceil(texels * scale)
        padded = np.ceil((size + 2 * GUTTER) / GUTTER) * GUTTER
        if padded.prod(axis=1).sum() * PIXEL_BYTES <= (1 - GEOMETRY) * OVERVIEW_BYTES:
            break
        scale /= 2
    return scale


def overview_glb(source: Textured, charts: np.ndarray, extras: Mapping[str, Any], *, copyright: str = "") -> bytes:
    """Some charts (k,), ascending, of a source of coarse rasters as one node around `extras["origin"]`, world metres; of
    OVERVIEW_BYTES at most: where it is more it is made coarser, and where it cannot be of fewer charts."""
    whole = replace(source, charts=replace(source.charts, building=np.zeros_like(source.charts.building)))
    frame = LocalFrame(np.array(extras["origin"], float))
    scale = 1.0
    while True:
        drawn = layout_of(whole, charts, scale)
        data = glb_bytes(nodes_of([drawn], {0: NODE}, frame)[0], jpegs(drawn), extras=extras, copyright=copyright)
        if len(data) <= OVERVIEW_BYTES or not len(charts):
            return data
        if scale * source.texels[charts].max() > 1:
            scale /= 2
        else:
            order = charts[np.argsort(-source.charts.size[charts].prod(axis=1), kind="stable")]
            charts = np.sort(order[: len(order) // 2])
