"""Planar faces of a building model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class ModelFace:
    """Planar face.

    Attributes
    ----------
    rings : (k, 3) corners, exterior first, unclosed, counter-clockwise as seen from outside, world metres.
    semantic : index of its semantic surface.
    uv : (k, 2) texture coordinates of each ring, u right and v up.
    page : texture page; None without.
    """

    rings: tuple[np.ndarray, ...]
    semantic: int
    uv: tuple[np.ndarray, ...] = ()
    page: int | None = None
