"""Names of shops: the text over and in shop fronts, without telephone numbers, addresses and lines with a person's title."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from facade_core.core.labels import FacadeClass
from facade_core.imagery.detect.text import Line

# Signs are in the shop front or at most so far above it, and stand at least by half in that zone.
ABOVE_M, WITHIN = 1.0, 0.5
# What is read with less certainty is no name, nor is what is hidden by more than this.
LEAST_SCORE, HIDDEN = 0.8, 0.3
# A name has at least so many letters, and they are most of it; so many digits are a telephone number.
LETTERS, MOSTLY, DIGITS = 3, 0.6, 5
# Of one facade.
MOST = 12
_ADDRESS = re.compile(r"@|\(at?\)|mail|www|\.[a-z]{2,3}$|\b(tel|phone|telephone|fax|mobile?)\b", re.IGNORECASE)
# Doctors, lawyers and owners sign with their own names.
_PERSON = re.compile(
    r"\b(dr|prof|med|not(ar|aris|aire|ary)|avocate?|advokat|advocaat|rechtsanw\w*|inh|prop|mme|mlle)\b", re.I
)


def shop_names(
    lines: Sequence[Line], labels: np.ndarray, hidden: np.ndarray, plates: np.ndarray, texels_per_metre: float
) -> list[str]:
    """The names on a facade from left to right, in letters as read, each once.

    labels (h, w) uint8, hidden (h, w) bool and the boxes of plates (n, 4) in texels, as are the lines.
    """
    import cv2

    above = max(1, round(ABOVE_M * texels_per_metre))
    # the anchor at the top: a texel is of the zone where there is a shop at it or below
    zone = cv2.dilate(
        (labels == FacadeClass.SHOP).astype(np.uint8), np.ones((above + 1, 1), np.uint8), anchor=(0, 0)
    ).astype(bool)
    names: dict[str, str] = {}
    for line in sorted(lines, key=lambda line: tuple(line.box[:2])):
        text = " ".join(line.text.split()).strip(" .,:;-_|/\\'\"*·")
        if line.score < LEAST_SCORE or not _is_name(text) or (plates == line.box).all(axis=1).any():
            continue
        x0, y0, x1, y1 = np.rint(line.box).astype(int)
        place = np.s_[max(0, y0) : max(y1, y0 + 1), max(0, x0) : max(x1, x0 + 1)]
        if zone[place].size and zone[place].mean() >= WITHIN and hidden[place].mean() <= HIDDEN:
            names.setdefault(text.casefold(), text)
    return list(names.values())[:MOST]


def _is_name(text: str) -> bool:
    letters, digits = (sum(map(test, text)) for test in (str.isalpha, str.isdigit))
    spelt = letters >= LETTERS and letters >= MOSTLY * len(text) and digits < DIGITS
    return spelt and not _ADDRESS.search(text) and not _PERSON.search(text)
