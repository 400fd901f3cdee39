"""Resolution of photos of facades on their walls."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catalogs.features import safe_file_stem
from facade_core.core.arrays import Float64Array
from facade_core.geometry.charts import raster_sizes
from facade_core.plan.identity import ParallelMap
from facade_core.plan.pictured_density import can_be_raised
from facade_core.plan.plan import Plan
from tasks.stages.ingest.photo_crops import count_crop_pixels
from tasks.stages.shared.memory import bounded_pixel_count

if TYPE_CHECKING:
    from catalogs.block.reader import Block


def read_photo_resolution(block: Block, plan: Plan) -> Float64Array:
    """Return the pixels per metre of rectified photos, which show their walls alone, by their headers.

    Returns
    -------
    (facades,), 0 of others.
    """
    photos = _photo_by_facade(block, plan) if block.photos_rectified else {}
    return _resolution(plan, {facade: bounded_pixel_count([photo]) for facade, photo in photos.items()})


def measure_photo_resolution(
    block: Block, plan: Plan, known: Mapping[str, int], parallel_map: ParallelMap
) -> tuple[Float64Array, dict[str, int]]:
    """Measure the pixels per metre that photos have on the walls of facades that they may raise.

    Photos as taken are opened and cropped to their walls.

    Parameters
    ----------
    known, parallel_map : as of `count_crop_pixels`.

    Returns
    -------
    resolution : (facades,), 0 without a usable photo.
    crops : pixels of crops by key, for later ingests.
    """
    if block.photos_rectified or not block.photos:
        return read_photo_resolution(block, plan), {}
    chart, raisable = plan.facades.chart, can_be_raised(plan)
    photos = {facade: photo for facade, photo in _photo_by_facade(block, plan).items() if raisable[facade]}
    texels = raster_sizes(plan.scene.charts.size[chart], plan.street_density[chart]).tolist()
    cases = [(photo, texels[facade][0] / texels[facade][1]) for facade, photo in photos.items()]
    counts, crops = count_crop_pixels(cases, block.models.parser, known, parallel_map)
    return _resolution(plan, dict(zip(photos, counts, strict=True))), crops


def _photo_by_facade(block: Block, plan: Plan) -> dict[int, Path]:
    found = (
        (facade, block.photos.get(id, block.photos.get(safe_file_stem(id))))
        for facade, id in enumerate(plan.facades.id)
    )
    return {facade: photo for facade, photo in found if photo is not None}


def _resolution(plan: Plan, pixels: Mapping[int, int]) -> Float64Array:
    """Return the pixels per metre, (facades,), of pixels on facades by index."""
    shown = np.zeros(len(plan.facades))
    shown[list(pixels)] = list(pixels.values())
    resolution: Float64Array = np.sqrt(shown / plan.scene.charts.size[plan.facades.chart].prod(axis=1))
    return resolution
