"""Where a texel's colour is from, and which source wins."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

# In rising rank: the value of a texel's provenance is its rank.
PROVENANCE = ("unseen", "material", "translated", "synthesised", "inpainted", "photo")


class Provenance(IntEnum):
    """Source of a texel's colour: the index of its name in `PROVENANCE`, which is also its rank."""

    UNSEEN = 0
    MATERIAL = 1
    TRANSLATED = 2
    SYNTHESISED = 3
    INPAINTED = 4
    PHOTO = 5


def resolve(
    seed: np.ndarray, evidence: np.ndarray, street: np.ndarray, views: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Colour and provenance of texels from the facade stages' seed and the street stage's result.

    seed, street (..., 3) uint8; evidence (...,) uint8 provenance of the seed, UNSEEN where there is none; views (...,) how many
    views made the street colour. Rank: photo > inpainted > synthesised > translated > unseen, which stays black: what it is
    made of is for `facade_core.street.surfaces` to say.
    """
    provenance = np.where(
        evidence > Provenance.UNSEEN, evidence, np.where(views > 0, Provenance.TRANSLATED, Provenance.UNSEEN)
    ).astype(np.uint8)
    colour = np.where(
        (evidence > Provenance.UNSEEN)[..., None], seed, np.where((views > 0)[..., None], street, 0)
    ).astype(np.uint8)
    return colour, provenance
