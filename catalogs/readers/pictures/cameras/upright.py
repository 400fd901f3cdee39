"""Cameras of pictures that their EXIF turns: a pose is of the stored picture, and the upright one is read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.core.types import Lens

# Quarter turns clockwise that make a picture of an EXIF orientation upright.
_QUARTER_TURNS = {1: 0, 6: 1, 3: 2, 8: 3}


def upright_camera(lens: Lens, rotation: Float64Array, orientation: int) -> tuple[Lens, Float64Array]:
    """Return lens and rotation (3, 3) to camera axes of the upright picture of a stored one.

    Raises
    ------
    ValueError
        Where the orientation mirrors, or the axes of the sensor are not at right angles.
    """
    if orientation not in _QUARTER_TURNS:
        raise ValueError("is mirrored by its EXIF; save it as it was taken, or remove it")
    for _ in range(_QUARTER_TURNS[orientation]):
        lens, rotation = _quarter_turn(lens), np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]) @ rotation
    return lens, rotation


def _quarter_turn(lens: Lens) -> Lens:
    """Return the lens of a picture turned clockwise by a quarter: its x axis is the former upward axis."""
    if lens.skew:
        raise ValueError("is turned by its EXIF, and its calibration has a skew; save it upright, and pose it again")
    p1, p2 = lens.tangential
    return replace(
        lens,
        size=lens.size[::-1],
        focal=lens.focal[::-1],
        centre=(lens.size[1] - lens.centre[1], lens.centre[0]),
        tangential=(p2, -p1),
    )
