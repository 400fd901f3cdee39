"""Share of a facade in the shadow of opposite buildings; such a photo is no source for wall textures."""

from __future__ import annotations

import math

import numpy as np
from scipy import ndimage

from facade_core.core.arrays import UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.parsing.floor_structure import count_floors

# Cells along the picture's longer side,
_CELLS = 48
# with at least this share of wall.
_MIN_WALL_SHARE = 0.2
# Sunlit wall is as bright as this quantile of the cells.
_SUNLIT_QUANTILE = 0.9
# Cells with less than this share of that light are in shadow.
_SHADOW_RATIO = 0.62
# A shadow of a building opposite is at least this tall, in storeys; a floor of dark stone and the shade of a balcony are lower.
_MIN_SHADOW_STOREYS = 1.25
# Cells of wall that a statement needs.
_MIN_CELLS = 20
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def shadow_share(image: UInt8Array, labels: UInt8Array) -> float:
    """Compute the share of a picture's wall that its largest shadow covers, 0 to 1.

    The brightness of a cell is the median of its wall, because mouldings and sills cast small shadows everywhere.
    Evenly lit walls, in the sun or in the shade, have almost none. Several floors of far darker stone count as shadow too.

    Parameters
    ----------
    image : (h, w, 3) uint8.
    labels : (h, w) uint8 class of each pixel.
    """
    height, width = labels.shape
    side = max(4, math.ceil(max(height, width) / _CELLS))
    luminance = np.where(labels == FacadeClass.WALL, (image * _LUMINANCE).sum(axis=2), np.nan)
    padded = np.pad(luminance, ((0, -height % side), (0, -width % side)), constant_values=np.nan)
    cells = padded.reshape(padded.shape[0] // side, side, -1, side).swapaxes(1, 2).reshape(-1, side * side)
    wall = (np.isfinite(cells).mean(1) >= _MIN_WALL_SHARE).reshape(padded.shape[0] // side, -1)
    if wall.sum() < _MIN_CELLS:
        return 0.0
    brightness = np.zeros(wall.shape)
    brightness[wall] = np.nanmedian(cells[wall.reshape(-1)], axis=1)
    dark = wall & (brightness < np.quantile(brightness[wall], _SUNLIT_QUANTILE) * _SHADOW_RATIO)
    # Shadows continue over windows and doors.
    nearest = ndimage.distance_transform_edt(~wall, return_distances=False, return_indices=True)
    least = min(len(dark), max(2, round(_MIN_SHADOW_STOREYS * height / max(1, count_floors(labels)) / side)))
    parts, _ = ndimage.label(ndimage.binary_opening(dark[tuple(nearest)], np.ones((least, 2))))
    return float(np.bincount(parts[wall], minlength=2)[1:].max() / wall.sum())
