"""A panorama from which ground or walls are textured."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from facade_core.core.types import Pose


class PosedPanorama(NamedTuple):
    """A panorama near a piece of ground: its file and pose, the factors to the common exposure, and the squares of ground
    that it shows, as of `facade_core.cameras.Ground`."""

    path: Path
    pose: Pose
    factor: tuple[float, ...]
    squares: tuple[tuple[int, ...], ...]
