"""Quick picture of a street: materials by pixel, and coarse rasters of facades."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from facade_core.core.arrays import IntArray, UInt8Array
from facade_core.export.pictures.camera import PerspectiveCamera
from facade_core.export.pictures.rendering import average_samples, cast_view
from facade_core.plan.plan import Plan
from facade_core.street.materials.field import MaterialField
from facade_core.street.translator.translators import pixel_footprint

# Height and width, pixels.
PREVIEW_SIZE = (540, 960)
# Rays along each side of a pixel.
SAMPLES_PER_PIXEL_SIDE = 2


def visible_charts(plan: Plan, camera: PerspectiveCamera) -> IntArray:
    """Return the charts (k,) that a camera sees, ascending."""
    return cast_view(plan.scene, camera, samples=1).visible_charts


def draw_preview(
    plan: Plan, materials: MaterialField, camera: PerspectiveCamera, facades: Mapping[int, UInt8Array]
) -> UInt8Array:
    """Draw the materials of all that a camera sees, and some facades over them, (h, w, 3) uint8.

    Parameters
    ----------
    plan : plan of the block.
    materials : material field of the block.
    camera : the camera.
    facades : raster (h, w, 3) by chart; it may be coarser than the atlas.
    """
    picture = cast_view(plan.scene, camera, samples=SAMPLES_PER_PIXEL_SIDE)
    rays = picture.camera.rays().reshape(-1, 3)[picture.pixel] * picture.depth[:, None]
    focal = picture.camera.axes()[3]
    covered = pixel_footprint(rays, plan.scene.charts.normals()[picture.chart], round(2 * np.pi * focal))
    flat = picture.rgb.reshape(-1, 3)
    flat[picture.pixel] = materials.colour(picture.chart, camera.position + rays, covered)
    picture.paint(facades)
    return average_samples(picture.apply_haze(), SAMPLES_PER_PIXEL_SIDE)
