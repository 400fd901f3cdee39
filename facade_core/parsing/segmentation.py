"""What a segmenter tells of an image."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Segmentation(NamedTuple):
    """confidence (H, W, 7) float32, rows sum to 1; hidden and outside (H, W) float32, the probabilities that something stands
    in front of the facade, and that sky, street or neighbours are seen beside it."""

    confidence: np.ndarray
    occluder: np.ndarray
    outside: np.ndarray
