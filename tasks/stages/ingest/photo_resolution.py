"""Resolution of photos of facades on their walls, by their headers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catalogs.readers.pictures.folders import find_facade_photo
from facade_core.core.arrays import Float64Array
from facade_core.core.errors import InputError
from facade_core.plan.plan import Plan
from tasks.stages.shared.images import MAX_PIXELS, image_size

if TYPE_CHECKING:
    from catalogs.block.reader import Block

# Share of the pixels of a photo as taken that show its facade: .36 to .95 of 23 street photos, .65 at the median.
FACADE_SHARE = 0.5


def photo_resolution(block: Block, plan: Plan) -> Float64Array:
    """Return the pixels per metre that photos have on the walls of their facades.

    A rectified photo shows its wall alone, and of a photo as taken FACADE_SHARE shows it.

    Returns
    -------
    (facades,), 0 without a photo.
    """
    share = 1.0 if block.photos_rectified else FACADE_SHARE
    pixels = np.zeros(len(plan.facades))
    for facade, id in enumerate(plan.facades.id):
        photo = find_facade_photo(block.photos, id)
        if photo is not None:
            pixels[facade] = share * _bounded_pixels(photo)
    resolution: Float64Array = np.sqrt(pixels / plan.scene.charts.size[plan.facades.chart].prod(axis=1))
    return resolution


def _bounded_pixels(photo: Path) -> int:
    """Return the pixels of a photo as a run reads it; 0 for a broken one, which fails when its facade reads it."""
    try:
        rows, columns = image_size(photo)
    except (InputError, OSError):
        return 0
    return min(rows * columns, MAX_PIXELS)
