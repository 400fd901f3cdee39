"""Shop names: text on and above shop fronts, without telephone numbers, addresses and personal titles."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.imagery.detect.settings import DETECTION
from facade_core.imagery.detect.text import TextLine

_ADDRESS = re.compile(r"@|\(at?\)|mail|www|\.[a-z]{2,3}$|\b(tel|phone|telephone|fax|mobile?)\b", re.IGNORECASE)
# Doctors, lawyers and owners use their own names on signs.
_PERSON = re.compile(
    r"\b(dr|prof|med|not(ar|aris|aire|ary)|avocate?|advokat|advocaat|rechtsanw\w*|inh|prop|mme|mlle)\b", re.I
)


def shop_names(
    lines: Sequence[TextLine], labels: UInt8Array, hidden: BoolArray, plates: Float64Array, texels_per_metre: float
) -> list[str]:
    """Select the shop names on a facade.

    Parameters
    ----------
    lines : recognised lines of text, in texels.
    labels : (h, w) uint8 class of each texel.
    hidden : (h, w) bool, texels that an occluder hides.
    plates : (n, 4) boxes of number plates in texels.
    texels_per_metre : density of the raster.

    Returns
    -------
    The names from left to right, as recognised, without duplicates.
    """
    import cv2

    zone_height = max(1, round(DETECTION.zone_above_shop_m * texels_per_metre))
    # anchor at the top: a texel is in the zone if it or a texel below it is a shop
    zone = cv2.dilate(
        (labels == FacadeClass.SHOP).astype(np.uint8), np.ones((zone_height + 1, 1), np.uint8), anchor=(0, 0)
    ).astype(bool)
    names: dict[str, str] = {}
    for line in sorted(lines, key=lambda line: tuple(line.box[:2])):
        text = " ".join(line.text.split()).strip(" .,:;-_|/\\'\"*·")
        if line.score < DETECTION.min_name_score or not _is_name(text) or (plates == line.box).all(axis=1).any():
            continue
        x0, y0, x1, y1 = np.rint(line.box).astype(int)
        box = np.s_[max(0, y0) : max(y1, y0 + 1), max(0, x0) : max(x1, x0 + 1)]
        if (
            zone[box].size
            and zone[box].mean() >= DETECTION.min_zone_share
            and hidden[box].mean() <= DETECTION.max_hidden_share
        ):
            names.setdefault(text.casefold(), text)
    return list(names.values())[: DETECTION.max_names]


def _is_name(text: str) -> bool:
    letters, digits = (sum(map(test, text)) for test in (str.isalpha, str.isdigit))
    is_word = (
        letters >= DETECTION.min_letters
        and letters >= DETECTION.min_letter_share * len(text)
        and digits < DETECTION.phone_digits
    )
    return is_word and not _ADDRESS.search(text) and not _PERSON.search(text)
