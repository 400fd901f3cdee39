"""Quick picture of a street: materials by pixel, and coarse rasters of facades."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from facade_core.core.arrays import Float64Array, UInt8Array
from facade_core.export.pictures.rendering import PictureInProgress, average_samples
from facade_core.export.pictures.settings import BLOCK_VIEWS
from facade_core.street.materials.field import MaterialField

# Lower bound of the cosine of incidence, for footprints near the horizon.
MIN_VIEW_COSINE = 0.02


def draw_preview(picture: PictureInProgress, materials: MaterialField, facades: Mapping[int, UInt8Array]) -> UInt8Array:
    """Draw the materials of all that a picture shows, and some facades over them, (h, w, 3) uint8.

    Parameters
    ----------
    picture : cast view of `samples_per_pixel_side`.
    materials : material field of the block.
    facades : raster (h, w, 3) by chart; it may be coarser than the atlas.
    """
    rays = picture.camera.rays().reshape(-1, 3)[picture.pixel] * picture.depth[:, None]
    focal = picture.camera.axes()[3]
    covered = pixel_footprint(rays, picture.scene.charts.normals()[picture.chart], round(2 * np.pi * focal))
    flat = picture.rgb.reshape(-1, 3)
    flat[picture.pixel] = materials.colour(picture.chart, picture.camera.position + rays, covered)
    picture.paint(facades)
    return average_samples(picture.apply_haze(), BLOCK_VIEWS.samples_per_pixel_side)


def pixel_footprint(ray: Float64Array, normal: Float64Array, width: int) -> Float64Array:
    """Compute the footprint of panorama pixels on surfaces.

    Parameters
    ----------
    ray : (n, 3) from the viewpoint to the surface, metres.
    normal : (n, 3) or (3,) unit normals.
    width : width of the panorama, pixels.

    Returns
    -------
    (n,) side of a square of equal area, metres.
    """
    depth = np.maximum(np.linalg.norm(ray, axis=1), 1e-6)
    flat = np.abs((ray * normal).sum(axis=1)) / depth
    footprint: Float64Array = depth * (2 * np.pi / width) / np.sqrt(np.maximum(flat, MIN_VIEW_COSINE))
    return footprint
