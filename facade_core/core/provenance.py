"""Where a texel's colour is from, and which source wins."""

from __future__ import annotations

import numpy as np

# In rising rank: the value of a texel's provenance is its rank.
PROVENANCE = ("unseen", "material", "translated", "synthesised", "inpainted", "photo")
UNSEEN, MATERIAL, TRANSLATED, SYNTHESISED, INPAINTED, PHOTO = range(6)


def resolve(
    seed: np.ndarray, evidence: np.ndarray, street: np.ndarray, views: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Colour and provenance of texels from the facade stages' seed and the street stage's result.

    seed, street (..., 3) uint8; evidence (...,) uint8 provenance of the seed, UNSEEN where there is none; views (...,) how many
    views made the street colour. Rank: photo > inpainted > synthesised > translated > unseen, which stays black: what it is
    made of is for `facade_core.street.surfaces` to say.
    """
    provenance = np.where(evidence > UNSEEN, evidence, np.where(views > 0, TRANSLATED, UNSEEN)).astype(np.uint8)
    colour = np.where((evidence > UNSEEN)[..., None], seed, np.where((views > 0)[..., None], street, 0)).astype(
        np.uint8
    )
    return colour, provenance
