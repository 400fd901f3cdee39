"""Shop names: text on and above shop fronts, without telephone numbers, addresses and personal titles."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.imagery.detect.text import TextLine

# Signs are in the shop front or at most this many metres above it,
ZONE_ABOVE_SHOP_M = 1.0
# with at least this share of their box.
MIN_ZONE_SHARE = 0.5
# Text that is recognised with a lower score is no name.
MIN_NAME_SCORE = 0.8
# Text that is hidden by a larger share is no name.
MAX_HIDDEN_SHARE = 0.3
# Letters that a name has at least.
MIN_LETTERS = 3
# Share of a name's characters that are letters.
MIN_LETTER_SHARE = 0.6
# This many digits are a telephone number.
PHONE_DIGITS = 5
# Names per facade.
MAX_NAMES = 12
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

    zone_height = max(1, round(ZONE_ABOVE_SHOP_M * texels_per_metre))
    # anchor at the top: a texel is in the zone if it or a texel below it is a shop
    zone = cv2.dilate(
        (labels == FacadeClass.SHOP).astype(np.uint8), np.ones((zone_height + 1, 1), np.uint8), anchor=(0, 0)
    ).astype(bool)
    names: dict[str, str] = {}
    for line in sorted(lines, key=lambda line: tuple(line.box[:2])):
        text = " ".join(line.text.split()).strip(" .,:;-_|/\\'\"*·")
        if line.score < MIN_NAME_SCORE or not _is_name(text) or (plates == line.box).all(axis=1).any():
            continue
        x0, y0, x1, y1 = np.rint(line.box).astype(int)
        box = np.s_[max(0, y0) : max(y1, y0 + 1), max(0, x0) : max(x1, x0 + 1)]
        if zone[box].size and zone[box].mean() >= MIN_ZONE_SHARE and hidden[box].mean() <= MAX_HIDDEN_SHARE:
            names.setdefault(text.casefold(), text)
    return list(names.values())[:MAX_NAMES]


def _is_name(text: str) -> bool:
    letters, digits = (sum(map(test, text)) for test in (str.isalpha, str.isdigit))
    is_word = letters >= MIN_LETTERS and letters >= MIN_LETTER_SHARE * len(text) and digits < PHONE_DIGITS
    return is_word and not _ADDRESS.search(text) and not _PERSON.search(text)
