"""Quick picture of a street: materials by pixel, and coarse rasters of facades."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from facade_core.core.arrays import UInt8Array
from facade_core.export.pictures.rendering import PictureInProgress, average_samples
from facade_core.export.pictures.settings import VIEW_SETTINGS, ViewSettings
from facade_core.street.materials.field import MaterialField
from facade_core.street.translator.translators import pixel_footprint


def draw_preview(
    picture: PictureInProgress,
    materials: MaterialField,
    facades: Mapping[int, UInt8Array],
    settings: ViewSettings = VIEW_SETTINGS,
) -> UInt8Array:
    """Draw the materials of all that a picture shows, and some facades over them, (h, w, 3) uint8.

    Parameters
    ----------
    picture : cast view of `samples_per_pixel_side`.
    materials : material field of the block.
    facades : raster (h, w, 3) by chart; it may be coarser than the atlas.
    settings : numbers of views.
    """
    rays = picture.camera.rays().reshape(-1, 3)[picture.pixel] * picture.depth[:, None]
    focal = picture.camera.axes()[3]
    covered = pixel_footprint(rays, picture.scene.charts.normals()[picture.chart], round(2 * np.pi * focal))
    flat = picture.rgb.reshape(-1, 3)
    flat[picture.pixel] = materials.colour(picture.chart, picture.camera.position + rays, covered)
    picture.paint(facades)
    return average_samples(picture.apply_haze(), settings.samples_per_pixel_side)
