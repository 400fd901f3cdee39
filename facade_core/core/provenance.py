"""Provenance of texels, and the rank of their sources."""

from __future__ import annotations

from enum import IntEnum

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
