"""Painted facades as a training set: their labels are true and without number."""

from __future__ import annotations

import numpy as np

from catalogs.learning.datasets import LabelledFacade
from facade_core.labels import CLASSES
from facade_core.parse.network_views import ANY_CLASS
from facade_core.synth import exemplars


def painted(number: int, *, seed: int) -> list[LabelledFacade]:
    """Facades painted with their truth; trees, cars and lamps stand before a fourth of them."""
    return [
        LabelledFacade(
            f"{seed}-{index}",
            facade.image,
            facade.labels,
            np.where(facade.labels < len(CLASSES), 1 << np.minimum(facade.labels, 7), ANY_CLASS).astype(np.uint8),
            facade.occluded.astype(np.uint8),
        )
        for index, facade in enumerate(exemplars(number, seed=seed, occluded_share=0.25))
    ]
