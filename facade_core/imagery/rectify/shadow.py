"""How much of a facade lies in the shadow of what stands opposite: no wall should be made of it, a shadow would fall twice."""

from __future__ import annotations

import math

import numpy as np
from scipy import ndimage

from facade_core.core.labels import FacadeClass

# The wall is looked at in so many cells along the picture's longer side, of which so much must be wall.
_CELLS, _LEAST_WALL = 48, 0.2
# Sunlit wall is as bright as its brightest tenth; what has less than this share of that light is in shadow.
_LIT, _SHADE = 0.9, 0.62
# Of fewer cells nothing can be said.
_FEWEST = 20
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
_DARKEST = 4.0


def shadow_share(image: np.ndarray, labels: np.ndarray) -> float:
    """The share of the wall of a picture (h, w, 3) uint8, labels (h, w) uint8, that the largest shadow on it covers, 0 to 1.

    A cell is as bright as the median of its wall: mouldings and sills throw small shadows everywhere. Walls that are lit alike,
    in the sun or all in the shade, have next to none. A storey of a far darker stone counts as shadow too.
    """
    height, width = labels.shape
    side = max(4, math.ceil(max(height, width) / _CELLS))
    luminance = np.where(labels == FacadeClass.WALL, np.log(np.maximum(image @ _LUMINANCE, _DARKEST)), np.nan)
    padded = np.pad(luminance, ((0, -height % side), (0, -width % side)), constant_values=np.nan)
    cells = padded.reshape(padded.shape[0] // side, side, -1, side).swapaxes(1, 2).reshape(-1, side * side)
    wall = (np.isfinite(cells).mean(1) >= _LEAST_WALL).reshape(padded.shape[0] // side, -1)
    if wall.sum() < _FEWEST:
        return 0.0
    brightness = np.zeros(wall.shape)
    brightness[wall] = np.nanmedian(cells[wall.reshape(-1)], axis=1)
    dark = wall & (brightness < np.quantile(brightness[wall], _LIT) + math.log(_SHADE))
    # Over windows and doors a shadow runs on.
    nearest = ndimage.distance_transform_edt(~wall, return_distances=False, return_indices=True)
    parts, _ = ndimage.label(ndimage.binary_opening(dark[tuple(nearest)], np.ones((2, 2))))
    return float(np.bincount(parts[wall], minlength=2)[1:].max() / wall.sum())
