"""Output of a segmenter."""

from __future__ import annotations

from typing import NamedTuple

from facade_core.core.arrays import Float32Array


class Segmentation(NamedTuple):
    """Class probabilities, occluders and surroundings of an image.

    Attributes
    ----------
    confidence : (H, W, 7) float32, sums to 1 per pixel.
    occluder : (H, W) float32 probability of an occluder in front of the facade.
    outside : (H, W) float32 probability of sky, street or neighbours outside the facade.
    """

    confidence: Float32Array
    occluder: Float32Array
    outside: Float32Array
