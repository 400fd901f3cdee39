"""Classification of text lines as number plates; prefers false positives, because plates get hidden."""

from __future__ import annotations

from facade_core.core.arrays import Float64Array
from facade_core.imagery.detect.settings import DETECTION
from facade_core.imagery.detect.text import TextLine, measure_line

# Letters that the recognition confuses with digits.
_LIKE_DIGITS = frozenset("OQDIBSZG")


def has_plate_shape(corners: Float64Array) -> bool:
    """Return True if a line of text with these corners (4, 2) is as long and high as a plate's."""
    length, height = measure_line(corners)
    return DETECTION.aspect_range[0] <= length / max(height, 1e-9) <= DETECTION.aspect_range[1]


def is_plate(line: TextLine, horizon: float) -> bool:
    """Return True if a line below the row `horizon` has a plate's shape and characters."""
    if line.corners[:, 1].mean() < horizon or not has_plate_shape(line.corners):
        return False
    characters = [letter for letter in line.text if letter.isalnum()]
    if (
        not DETECTION.character_count_range[0] <= len(characters) <= DETECTION.character_count_range[1]
        or sum(letter.islower() for letter in characters) >= len(characters) / 2
    ):
        return False
    digits = sum(letter.isdigit() for letter in characters)
    digit_like = sum(letter in _LIKE_DIGITS for letter in characters)
    return digits >= 2 or (digits == 1 and digit_like >= 1)
