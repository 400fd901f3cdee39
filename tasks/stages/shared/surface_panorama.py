"""A panorama from which ground or walls are textured."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from facade_core.core.types import Pose


class SurfacePanorama(NamedTuple):
    """A panorama near a surface.

    Attributes
    ----------
    path : its file.
    pose : its pose.
    factor : factors to the common exposure.
    squares : squares of ground that it shows.
    """

    path: Path
    pose: Pose
    factor: tuple[float, ...]
    squares: tuple[tuple[int, ...], ...]
