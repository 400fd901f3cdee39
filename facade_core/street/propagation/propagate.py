"""Texture propagation: a translated panorama into the texels that it shows.

References
----------
Street paper, 3 Texture propagation.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int32Array, Int64Array, UInt8Array
from facade_core.core.errors import GeometryError
from facade_core.core.fixed_order import multiply_vector
from facade_core.core.numba_cache import njit
from facade_core.core.provenance import Provenance
from facade_core.geometry.equirectangular import upright_rotation
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint
from facade_core.geometry.visible_tiles import VISIBLE_TILE_TEXELS, FacingCharts, mark_visible_texel_tiles
from facade_core.street.propagation.blend import BlendState, add_view, blend_texel, is_fallback_view
from facade_core.street.propagation.texel_buffer import TexelBuffer

# Cosine of incidence below which a panorama pixel covers metres of a surface, without detail.
MIN_FACING_COSINE = 0.02
# A view is proper within this many viewpoint spacings along the street (docs/decisions/0010).
GATE_SPACINGS = 1.5


class TranslatedPanorama(NamedTuple):
    """Translated panorama as the kernels read it.

    Attributes
    ----------
    id : id of the viewpoint.
    gate : distance along the street within which the view is proper, millimetres.
    camera : (3, 3) rotation.
    rgb : (h, w, 3) uint8 colour.
    surface : (h, w) surface per pixel, -1 for none.
    kinds : (h, w) uint8 kind of surface per pixel.
    """

    id: int
    gate: int
    camera: Float64Array
    rgb: UInt8Array
    surface: Int32Array
    kinds: UInt8Array


def propagate_panorama(
    scene: Scene,
    buffer: TexelBuffer,
    viewpoint: Viewpoint,
    rgb: UInt8Array,
    *,
    charts_seen: Int32Array | None = None,
    kinds: UInt8Array | None = None,
) -> None:
    """Blend a translated panorama into the buffer's writable charts, in place.

    A texel takes the view if it faces the camera within the visibility range, its pixel shows its surface, and that
    pixel or a neighbour shows its chart. This is exact for planar surfaces up to one pixel and never takes colour from
    an occluder. Colour is bilinear over the pixels of the texel's surface and kind. The distance is
    d = |forward . (p - c)|.

    Parameters
    ----------
    scene : the block's geometry.
    buffer : texels that the street reads and writes.
    viewpoint : position and direction of the panorama.
    rgb : (h, w, 3) uint8 translated panorama.
    charts_seen : (h, w) int32 chart index per pixel, -1 where the sky is seen; computed if None.
    kinds : (h, w) uint8 kind of surface per pixel; one kind if None.

    Raises
    ------
    GeometryError
        The buffer was allocated for a shorter visibility range.
    """
    if charts_seen is None:
        charts_seen = scene.cast_panorama(viewpoint, rgb.shape[1])[2]
    visible = buffer.writable[np.isin(buffer.writable, charts_seen)]
    if len(visible) == 0:
        return
    if 1000 * scene.visibility_range > np.iinfo(buffer.state.top_distance.dtype).max:
        raise GeometryError(
            f"the buffer holds views to 65 m and the scene's reach {scene.visibility_range} m; "
            "give TexelBuffer.allocate the scene's visibility_range"
        )
    facing, surface, camera, marked = _facing_charts(scene, buffer, viewpoint, visible, charts_seen)
    kinds = np.zeros(surface.shape, np.uint8) if kinds is None else kinds
    view = TranslatedPanorama(viewpoint.id, round(1000 * (GATE_SPACINGS * scene.spacing)), camera, rgb, surface, kinds)
    _blend_tiles(buffer.state, buffer.colour, buffer.provenance, buffer.kinds, facing, view, marked)


def _facing_charts(
    scene: Scene, buffer: TexelBuffer, viewpoint: Viewpoint, visible: Int64Array, charts_seen: Int32Array
) -> tuple[FacingCharts, Int32Array, Float64Array, BoolArray]:
    """Prepare the visible charts for the kernels.

    Returns the charts in camera space, the surface per pixel, the camera's rotation, and the tiles that pixels may hit.
    """
    charts, placement = scene.charts, scene.placement
    place = np.full(len(charts), -1, np.int64)
    place[visible] = np.arange(len(visible))
    origin, normal = charts.origin[visible] - viewpoint.position, charts.normals()[visible]
    # farther texels are out of range, seen at a grazing angle, or from behind
    farthest = np.clip(-np.einsum("ij,ij->i", normal, origin) / MIN_FACING_COSINE, 0, scene.visibility_range)
    facing = FacingCharts(
        origin,
        charts.axis_u[visible],
        charts.axis_v[visible],
        normal,
        farthest,
        1.0 / placement.texels_per_metre[visible],
        placement.width[visible].astype(np.int64),
        placement.height[visible].astype(np.int64),
        charts.surface[visible],
        buffer.layout.offset[visible],
    )
    surface, camera = np.where(charts_seen >= 0, charts.surface[charts_seen], -1), upright_rotation(viewpoint.forward)
    return facing, surface, camera, mark_visible_texel_tiles(charts_seen, surface, place, camera, facing)


@njit(cache=True, inline="always", error_model="numpy")
def _fast_atan2(right: float, ahead: float) -> float:
    """Compute atan2(right, ahead) to 3e-10 rad without a branch, so that loops vectorise."""
    a, b = abs(right), abs(ahead)
    small, large = min(a, b), max(a, b)
    # beyond tan(pi / 8) the remainder to pi / 4 is the smaller angle
    folded = small > 0.41421356237309503 * large
    z = (small - large if folded else small) / max(small + large if folded else large, 1e-300)
    s = z * z
    # atan(z) / z as a polynomial of z^2 for |z| <= tan(pi / 8): interpolated at Chebyshev points
    angle = -0.0602630521375
    angle = angle * s + 0.105698287931
    angle = angle * s - 0.142395326662
    angle = angle * s + 0.199981830408
    angle = angle * s - 0.33333306893
    angle = (angle * s + 0.999999999371) * z
    angle = angle + 0.7853981633974483 if folded else angle
    angle = 1.5707963267948966 - angle if a > b else angle
    angle = np.pi - angle if ahead < 0 else angle
    return -angle if right < 0 else angle


@njit(cache=True, inline="always", error_model="numpy")
def _project_row(
    origin: Float64Array,
    step: Float64Array,
    columns: int,
    rows: int,
    column_at: Float64Array,
    row_at: Float64Array,
    depth: Float64Array,
    level: Float64Array,
) -> None:
    """Project n texels of a row into the panorama.

    Writes the pixel position, the depth along the street in metres, and the squared distance from the camera's vertical
    axis. origin, step (3,): first texel and the offset to the next.
    """
    for i in range(len(depth)):
        right, down, ahead = origin[0] + i * step[0], origin[1] + i * step[1], origin[2] + i * step[2]
        flat = right * right + ahead * ahead
        depth[i], level[i] = ahead, flat
        column_at[i] = (_fast_atan2(right, ahead) * (0.5 / np.pi) + 0.5) * columns
        row_at[i] = (0.5 + _fast_atan2(down, np.sqrt(flat)) * (1.0 / np.pi)) * rows


@njit(cache=True, inline="always")
def _shows(surface: Int32Array, kinds: UInt8Array, row: int, column: int, own: int, kind: int) -> bool:
    """Return True if a pixel shows a surface and a kind of it."""
    shows: bool = surface[row, column] == own and kinds[row, column] == kind
    return shows


@njit(cache=True, nogil=True, error_model="numpy")
def _blend_tiles(
    state: BlendState,
    resolved: UInt8Array,
    provenance: UInt8Array,
    kinds: UInt8Array,
    charts: FacingCharts,
    view: TranslatedPanorama,
    marked: BoolArray,
) -> None:
    """Blend the marked tiles."""
    rgb, surface, kinds_at, gate, camera = view.rgb, view.surface, view.kinds, view.gate, view.camera
    rows, columns = surface.shape
    origin, axis_u, axis_v, farthest = charts.origin, charts.axis_u, charts.axis_v, charts.farthest
    width, height, surface_ids, offset = charts.width, charts.height, charts.surface, charts.offset
    colour = np.zeros(3, np.int64)
    columns_at, rows_at, depths, levels = (
        np.empty(VISIBLE_TILE_TEXELS),
        np.empty(VISIBLE_TILE_TEXELS),
        np.empty(VISIBLE_TILE_TEXELS),
        np.empty(VISIBLE_TILE_TEXELS),
    )
    first = np.empty(3)
    tile = -1
    for c in range(len(origin)):
        # the chart's frame in camera space: right, down, ahead
        o, u, v = (
            multiply_vector(camera, origin[c]),
            multiply_vector(camera, axis_u[c]),
            multiply_vector(camera, axis_v[c]),
        )
        step = charts.step[c]
        along = step * u
        for top in range(0, height[c], VISIBLE_TILE_TEXELS):
            for left in range(0, width[c], VISIBLE_TILE_TEXELS):
                tile += 1
                if not marked[tile]:
                    continue
                for j in range(top, min(top + VISIBLE_TILE_TEXELS, height[c])):
                    x, y = (left + 0.5) * step, (j + 0.5) * step
                    for axis in range(3):
                        first[axis] = o[axis] + x * u[axis] + y * v[axis]
                    _project_row(first, along, columns, rows, columns_at, rows_at, depths, levels)
                    for k in range(min(VISIBLE_TILE_TEXELS, width[c] - left)):
                        down = first[1] + k * along[1]
                        squared = levels[k] + down * down
                        if squared > farthest[c] * farthest[c]:
                            continue
                        d = int(abs(depths[k]) * 1000 + 0.5)
                        t = offset[c] + j * width[c] + left + k
                        if d > gate and not is_fallback_view(state, t, d, view.id):
                            continue
                        column_at, row_at = columns_at[k], rows_at[k]
                        # comparisons, because remainders and floors would dominate the run time
                        row, column = min(int(row_at), rows - 1), int(column_at)
                        if column >= columns:
                            column = 0
                        own, kind = surface_ids[c], kinds[t]
                        if not _shows(surface, kinds_at, row, column, own, kind):
                            continue
                        u0, v0 = int(column_at + 0.5) - 1, int(row_at + 0.5) - 1
                        across, below = column_at - 0.5 - u0, row_at - 0.5 - v0
                        left_at = u0 if u0 >= 0 else columns - 1
                        right_at = u0 + 1 if u0 + 1 < columns else 0
                        above_at, below_at = max(v0, 0), min(v0 + 1, rows - 1)
                        # bilinear weights; pixels of other surfaces have none
                        w00 = (1 - across) * (1 - below) * _shows(surface, kinds_at, above_at, left_at, own, kind)
                        w01 = across * (1 - below) * _shows(surface, kinds_at, above_at, right_at, own, kind)
                        w10 = (1 - across) * below * _shows(surface, kinds_at, below_at, left_at, own, kind)
                        w11 = across * below * _shows(surface, kinds_at, below_at, right_at, own, kind)
                        total = w00 + w01 + w10 + w11
                        if total <= 0:
                            continue
                        share = 1.0 / total
                        for band in range(3):
                            value = w00 * rgb[above_at, left_at, band] + w01 * rgb[above_at, right_at, band]
                            value += w10 * rgb[below_at, left_at, band] + w11 * rgb[below_at, right_at, band]
                            colour[band] = int(value * share + 0.5)
                        add_view(state, t, d, d <= gate, view.id, colour)
                        if provenance[t] <= Provenance.TRANSLATED:
                            provenance[t] = Provenance.TRANSLATED
                            blend_texel(state, t, resolved)
