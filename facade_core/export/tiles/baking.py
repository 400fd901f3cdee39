"""Baking of a building's textures on simpler surfaces by ray casting."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, IntArray, UInt8Array
from facade_core.export.models.textured_mesh import TexturedMesh
from facade_core.export.tiles.settings import FAR_SHELLS
from facade_core.geometry.charts import ChartKind, Charts, Mesh
from facade_core.geometry.raycast import MISS, RayCaster


class ShellRasters(NamedTuple):
    """Rasters of the charts of shells.

    Attributes
    ----------
    charts : charts of the shells.
    texels : (n, 2) width and height of the rasters.
    density : texels per metre.
    """

    charts: Charts
    texels: IntArray
    density: float


def bake_rasters(
    source: TexturedMesh,
    triangles: IntArray,
    shells: ShellRasters,
    baked_charts: IntArray,
    rasters: Sequence[Callable[[int], UInt8Array]],
) -> list[dict[int, UInt8Array]]:
    """Bake rasters of a building on the charts of its shell.

    Texels without a hit take the nearest colour of their chart, else the mean of the building.

    Parameters
    ----------
    source : mesh to bake from.
    triangles : (t,) triangles of the building in the source.
    shells : rasters of all shells.
    baked_charts : (k,) charts of this building's shell.
    rasters : layers to bake; each returns the raster of a source chart at any size.

    Returns
    -------
    Per layer, the raster (h, w, 3) uint8 of every baked chart.
    """
    (charts, texels, density), mesh = shells, source.mesh
    used, index = np.unique(mesh.triangles[triangles], return_inverse=True)
    own = Mesh(
        mesh.vertices[used], index.reshape(-1, 3).astype(np.int32), mesh.chart[triangles], mesh.vertex_chart[used]
    )
    caster = RayCaster(own)
    highest = own.vertices[:, 2].max()
    normals = charts.normals()
    shown: list[dict[int, tuple[UInt8Array, BoolArray]]] = [{} for _ in rasters]
    for chart in baked_charts.tolist():
        width, height = texels[chart].tolist()
        x = (np.arange(width * FAR_SHELLS.samples_per_texel) + 0.5) / FAR_SHELLS.samples_per_texel / density
        y = (np.arange(height * FAR_SHELLS.samples_per_texel) + 0.5) / FAR_SHELLS.samples_per_texel / density
        # the edge of a shell, and its last texel, may exceed the building: a ray there would miss it
        x, y = (
            np.clip(v, FAR_SHELLS.min_edge_distance_m, side - FAR_SHELLS.min_edge_distance_m)
            for v, side in zip((x, y), charts.size[chart], strict=True)
        )
        points = charts.points(chart, x[None], y[:, None])
        wall = charts.kind[chart] == ChartKind.WALL
        before = FAR_SHELLS.ray_start_m if wall else highest - charts.origin[chart, 2] + 1.0
        ahead = -normals[chart]
        origins = points - before * ahead
        depth, hit = caster.cast(origins, np.broadcast_to(ahead, points.shape))
        found = (hit != MISS) & (depth < (before + FAR_SHELLS.max_ray_behind_m if wall else np.inf))
        for baked, raster in zip(shown, rasters, strict=True):
            colour = np.zeros((*hit.shape, 3), np.uint8)
            colour[found] = _sample_colours(source, hit[found], origins[found] + depth[found][:, None] * ahead, raster)
            baked[chart] = colour, found
    return [_complete_rasters(baked) for baked in shown]


def _complete_rasters(shown: Mapping[int, tuple[UInt8Array, BoolArray]]) -> dict[int, UInt8Array]:
    seen = [colour[found] for colour, found in shown.values() if found.any()]
    mean = np.concatenate(seen).mean(axis=0) if seen else np.full(3, 128.0)
    return {chart: _average_samples(_fill_missing(colour, found, mean)) for chart, (colour, found) in shown.items()}


def _sample_colours(
    source: TexturedMesh, chart: IntArray, points: Float64Array, raster_of_chart: Callable[[int], UInt8Array]
) -> UInt8Array:
    """Return the colours (k, 3) of the texels at points (k, 3) of charts (k,)."""
    share = source.charts.coordinates(chart, points) / source.extent[chart]
    colours = np.empty((len(chart), 3), np.uint8)
    for one in np.unique(chart).tolist():
        here, raster = chart == one, raster_of_chart(one)
        size = np.array(raster.shape[1::-1])
        column, row = np.clip((share[here] * size).astype(np.int64), 0, size - 1).T
        colours[here] = raster[row, column]
    return colours


def _fill_missing(colour: UInt8Array, found: BoolArray, mean: Float64Array) -> UInt8Array:
    from scipy.ndimage import distance_transform_edt

    if found.all():
        return colour
    if not found.any():
        return np.broadcast_to(mean.round().astype(np.uint8), colour.shape)
    nearest = distance_transform_edt(~found, return_distances=False, return_indices=True)
    filled: UInt8Array = colour[tuple(nearest)]
    return filled


def _average_samples(colour: UInt8Array) -> UInt8Array:
    height, width, _ = colour.shape
    cells = colour.reshape(
        height // FAR_SHELLS.samples_per_texel,
        FAR_SHELLS.samples_per_texel,
        width // FAR_SHELLS.samples_per_texel,
        FAR_SHELLS.samples_per_texel,
        3,
    )
    averaged: UInt8Array = cells.mean(axis=(1, 3)).round().astype(np.uint8)
    return averaged
