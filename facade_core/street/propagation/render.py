"""Partially textured panorama of a viewpoint (street paper, 3 Rendering)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, Int32Array, UInt8Array
from facade_core.core.errors import GeometryError
from facade_core.core.fixed_order import multiply_matrices
from facade_core.geometry.raycast import MISS
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint
from facade_core.street.propagation.propagate import GATE_SPACINGS
from facade_core.street.propagation.sampling import (
    ChartTexelFrames,
    DaylightGrids,
    PanoramaPixels,
    ViewGate,
    colour_panorama_pixels,
)
from facade_core.street.propagation.texel_buffer import TexelBuffer

# Soft daylight: a hemisphere of sky plus a low sun from the south-west.
SUN_DIRECTION = np.array([-0.45, -0.6, 0.66])
AMBIENT_LIGHT = 0.72
# Grey of geometry beyond the visibility range, which is neither read nor written.
OUT_OF_RANGE_GREY = 160


@dataclass(frozen=True)
class RenderedPanorama:
    """Rendered panorama of a viewpoint.

    Attributes
    ----------
    viewpoint : position and direction of the panorama.
    rgb : (h, w, 3) uint8; textured parts in colour, others in grey under soft daylight, sky black.
    textured : (h, w) bool.
    depth : (h, w) float32 metres, inf for sky.
    chart : (h, w) int32 chart index, -1 for sky and beyond the visibility range.
    points : (h, w, 3) float64 world points.
    """

    viewpoint: Viewpoint
    rgb: UInt8Array
    textured: BoolArray
    depth: Float32Array
    chart: Int32Array
    points: Float64Array


def daylight_grey(normals: Float64Array) -> Float64Array:
    """Compute the grey of a white surface under soft daylight.

    Parameters
    ----------
    normals : (..., 3) unit normals.

    Returns
    -------
    (...,) in 0..1.
    """
    sky = 0.5 + 0.5 * normals[..., 2]
    sun = np.clip(multiply_matrices(normals, SUN_DIRECTION / np.sqrt((SUN_DIRECTION**2).sum())), 0, 1)
    grey: Float64Array = np.clip(AMBIENT_LIGHT + 0.12 * sky + 0.16 * sun, 0, 1)
    return grey


def render_panorama(
    scene: Scene, buffer: TexelBuffer, viewpoint: Viewpoint, size: tuple[int, int], *, shaded: bool = True
) -> RenderedPanorama:
    """Render a viewpoint with the texels of a buffer.

    Texels of provenance 0 and charts outside the buffer count as untextured. Within the distance gate so do texels with
    only a fallback view (docs/decisions/0010).

    Parameters
    ----------
    scene : the block's geometry.
    buffer : texels that the street reads and writes.
    viewpoint : position and direction of the panorama.
    size : height and width in pixels; width = 2 height.
    shaded : whether untextured parts show soft daylight, for which rays are cast; else they are black.

    Raises
    ------
    GeometryError
        The panorama is not twice as wide as high.
    """
    height, width = size
    if width != 2 * height:
        raise GeometryError(
            f"an equirectangular panorama is twice as wide as high, not {width} x {height}; change the size"
        )
    rays, depth, chart = scene.cast_panorama(viewpoint, width)
    charts, placement, rasters = scene.charts, scene.placement, buffer.layout
    normal = charts.normals()
    rgb = np.zeros((height, width, 3), np.uint8)
    rgb[np.isfinite(depth) & (chart == MISS)] = OUT_OF_RANGE_GREY
    textured = np.zeros((height, width), bool)
    sheets = ChartTexelFrames(
        charts.origin,
        charts.axis_u,
        charts.axis_v,
        normal,
        placement.texels_per_metre,
        rasters.offset,
        placement.width,
        placement.height,
        255 * daylight_grey(normal),
    )
    if shaded:
        daylight = scene.daylight
        daylight.compute(np.unique(chart[chart != MISS]))
        lights = DaylightGrids(daylight.start, daylight.columns, daylight.rows, daylight.light)
    else:
        cell = np.full(len(charts), 2, np.int64)
        lights = DaylightGrids(np.zeros_like(cell), cell, cell, np.zeros(4, np.float32))
    pixels = PanoramaPixels(rays, depth, chart)
    gate = ViewGate(viewpoint.forward, GATE_SPACINGS * scene.spacing)
    texels = (buffer.colour, buffer.provenance, buffer.state.views)
    colour_panorama_pixels(pixels, viewpoint.position, sheets, lights, *texels, gate, rgb, textured)
    points = viewpoint.position + rays * np.where(np.isfinite(depth), depth, 0)[..., None]
    return RenderedPanorama(viewpoint, rgb, textured, depth, chart, points)
