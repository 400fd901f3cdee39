"""Provenance of texels, and the rank of their sources."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from facade_core.core.arrays import UInt8Array, UInt16Array

# Names by rising rank; the value of a texel is its rank.
PROVENANCE = ("unseen", "material", "translated", "synthesised", "inpainted", "photo")


class Provenance(IntEnum):
    """Source of a texel's colour: the index of its name in `PROVENANCE`, which is also its rank."""

    UNSEEN = 0
    MATERIAL = 1
    TRANSLATED = 2
    SYNTHESISED = 3
    INPAINTED = 4
    PHOTO = 5


def merge_atlas_layers(
    seed: UInt8Array, evidence: UInt8Array, street: UInt8Array, views: UInt16Array
) -> tuple[UInt8Array, UInt8Array]:
    """Merge base layer and street layer of the atlas by rank into colour and provenance.

    Rank: photo > inpainted > synthesised > translated > unseen. Unseen texels stay black; `facade_core.street.surfaces`
    fills them.

    Parameters
    ----------
    seed : (..., 3) RGB of the base layer.
    evidence : (...) provenance of the base layer, UNSEEN where it is empty.
    street : (..., 3) RGB of the street stage.
    views : (...) number of views behind the street colour.

    Returns
    -------
    (..., 3) RGB, and (...) provenance.
    """
    provenance = np.where(
        evidence > Provenance.UNSEEN, evidence, np.where(views > 0, Provenance.TRANSLATED, Provenance.UNSEEN)
    ).astype(np.uint8)
    colour = np.where(
        (evidence > Provenance.UNSEEN)[..., None], seed, np.where((views > 0)[..., None], street, 0)
    ).astype(np.uint8)
    return colour, provenance
