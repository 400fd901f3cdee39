"""Rasters of charts from the textures of their model."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int64Array, UInt8Array
from facade_core.core.numba_cache import njit
from facade_core.geometry.scene import Scene
from facade_core.imagery.rectify.area_means import build_pyramid, write_parallelogram_mean

# Tolerance of barycentric coordinates at a triangle's edge, for rounding.
EDGE_TOLERANCE = 1e-6
# Pixels by which texture coordinates of 0 or 1 may miss the picture's border.
BORDER_TOLERANCE = 0.01
# Pixels kept around the part of a picture that a chart uses.
CROP_MARGIN = 4


def render_model_texture(scene: Scene, chart: int, images: Mapping[int, UInt8Array]) -> tuple[UInt8Array, BoolArray]:
    """Render a chart from its model's own textures, at its size in the atlas.

    Triangles without texture, or without a picture, stay black. Colours extend one texel beyond the textured triangles,
    which counts as covered.

    Parameters
    ----------
    scene : scene that contains the chart.
    chart : index of the chart.
    images : texture index -> (H, W, 3) uint8; u is right, v up, and textures repeat beyond 0 to 1.

    Returns
    -------
    rgb (h, w, 3) uint8 and covered (h, w) bool.
    """
    mesh, charts = scene.mesh, scene.charts
    shape = scene.placement.shape(chart)
    rgb, covered = np.zeros((*shape, 3), np.uint8), np.zeros(shape, np.bool_)
    triangles = mesh.chart_triangles(chart)
    corners = mesh.vertices[mesh.triangles[triangles]] - charts.origin[chart]
    flat = (
        corners
        @ np.column_stack([charts.axis_u[chart], charts.axis_v[chart]])
        * scene.placement.texels_per_metre[chart]
    )
    texture = np.where(np.isfinite(mesh.uv[triangles]).all(axis=(1, 2)), mesh.texture[triangles], -1)
    for index in np.unique(texture[texture >= 0]).tolist():
        if index not in images:
            continue
        used = texture == index
        part, pixels, repeat = _used_part(images[index], mesh.uv[triangles[used]].astype(np.float64))
        levels = build_pyramid(part)
        _rasterise(levels.pixels, levels.levels, flat[used], pixels, repeat, rgb, covered)
    return _extend_colour(rgb, covered)


def _used_part(image: UInt8Array, uv: Float64Array) -> tuple[UInt8Array, Float64Array, bool]:
    """Part of a picture that coordinates (t, 3, 2) use, their pixels in it (t, 3, 2), and True if it repeats.

    Charts mostly use a small part of a shared picture. Coordinates within the picture take no colour from the opposite
    border.
    """
    height, width = image.shape[:2]
    pixels = uv * (width, -height) + (0.0, height)
    low, high = pixels.min(axis=(0, 1)), pixels.max(axis=(0, 1))
    if (low < -BORDER_TOLERANCE).any() or (high > np.array([width, height]) + BORDER_TOLERANCE).any():
        return image, pixels, True
    left, top = np.clip(np.floor(low) - CROP_MARGIN, 0, None).astype(int)
    right, bottom = np.ceil(high).astype(int) + CROP_MARGIN
    return image[top:bottom, left:right], pixels - (left, top), False


@njit(cache=True, nogil=True)
def _rasterise(
    pixels: UInt8Array,
    levels: Int64Array,
    corners: Float64Array,
    source: Float64Array,
    repeat: bool,
    rgb: UInt8Array,
    covered: BoolArray,
) -> None:
    """Fill the texels with centres in triangles; corners and source (t, 3, 2) in texels and texture pixels."""
    rows, columns = covered.shape
    for t in range(len(corners)):
        x0, y0 = corners[t, 0]
        ex, ey = corners[t, 1] - corners[t, 0]
        fx, fy = corners[t, 2] - corners[t, 0]
        area = ex * fy - ey * fx
        if abs(area) < 1e-12:
            continue
        # barycentric coordinates of the second and third corner, per texel right and down
        sx, sy, tx, ty = fy / area, -fx / area, -ey / area, ex / area
        px, py = source[t, 0]
        du = source[t, 1] - source[t, 0]
        dv = source[t, 2] - source[t, 0]
        ax, ay = sx * du[0] + tx * dv[0], sx * du[1] + tx * dv[1]
        bx, by = sy * du[0] + ty * dv[0], sy * du[1] + ty * dv[1]
        first_row = max(0, int(np.floor(corners[t, :, 1].min() - 0.5)))
        last_row = min(rows - 1, int(np.ceil(corners[t, :, 1].max() - 0.5)))
        first_column = max(0, int(np.floor(corners[t, :, 0].min() - 0.5)))
        last_column = min(columns - 1, int(np.ceil(corners[t, :, 0].max() - 0.5)))
        for r in range(first_row, last_row + 1):
            for c in range(first_column, last_column + 1):
                dx, dy = c + 0.5 - x0, r + 0.5 - y0
                s, w = sx * dx + sy * dy, tx * dx + ty * dy
                if s < -EDGE_TOLERANCE or w < -EDGE_TOLERANCE or s + w > 1 + EDGE_TOLERANCE:
                    continue
                x = px + s * du[0] + w * dv[0]
                y = py + s * du[1] + w * dv[1]
                write_parallelogram_mean(pixels, levels, x, y, ax, ay, bx, by, repeat, rgb[r, c])
                covered[r, c] = True


def _extend_colour(rgb: UInt8Array, covered: BoolArray) -> tuple[UInt8Array, BoolArray]:
    """Extend colours by one texel: the mean of the covered neighbours."""
    import cv2

    around = cv2.boxFilter(covered.astype(np.float32), -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT)
    colour = cv2.boxFilter(rgb.astype(np.float32), -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT)
    rim = ~covered & (around > 0.5)
    rgb[rim] = np.round(colour[rim] / around[rim][:, None])
    return rgb, covered | rim
