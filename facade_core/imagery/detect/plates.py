"""Lines of text that may be number plates: rather one too many than one too few, for what is taken for one is hidden."""

from __future__ import annotations

from facade_core.imagery.detect.text import Line

# Length over height of what may be a plate, seen from aside or in two lines too; European ones are 4.7, with their rims.
SHAPE = (1.2, 8.0)
# Letters and digits on a plate, as far as they are read.
SIGNS = (4, 10)
# Letters that are read where digits stand.
_LIKE_DIGITS = frozenset("OQDIBSZG")


def is_plate(line: Line, horizon: float) -> bool:
    """Whether a line may be a plate: it stands below the row `horizon`, and has the shape and the signs of one."""
    length, height = line.size
    if line.corners[:, 1].mean() < horizon or not SHAPE[0] <= length / max(height, 1e-9) <= SHAPE[1]:
        return False
    signs = [letter for letter in line.text if letter.isalnum()]
    if not SIGNS[0] <= len(signs) <= SIGNS[1] or sum(letter.islower() for letter in signs) >= len(signs) / 2:
        return False
    digits = sum(letter.isdigit() for letter in signs)
    like = sum(letter in _LIKE_DIGITS for letter in signs)
    return digits >= 2 or (digits == 1 and like >= 1)
