"""What the benchmark of walls from exemplars counts, on labels of which the answer is known."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from benchmarks.look.exemplar_walls import (
    are_cut,
    count_defects,
    ground_proportions,
    measure_wall,
    odd_pitches,
    row_proportions,
)
from facade_core.core.labels import FacadeClass

DENSITY = 10.0


def wall(storeys: tuple[float, ...], *, window: tuple[float, float] = (1.0, 1.6), roof: float = 0.0) -> np.ndarray:
    """A wall of 12 m with storeys of some heights, from the top, and a roof painted over them; windows as width and height."""
    lines = roof + np.append(0.0, np.cumsum(storeys))
    labels = np.full((round(lines[-1] * DENSITY), 120), FacadeClass.WALL, np.uint8)
    labels[: round(roof * DENSITY)] = FacadeClass.ROOF
    for top, bottom in pairwise(lines):
        first = round(((top + bottom) / 2 - window[1] / 2) * DENSITY)
        for left in (10, 45, 80):
            rows, columns = slice(first, first + round(window[1] * DENSITY)), slice(left, left + round(10 * window[0]))
            labels[rows, columns] = FacadeClass.WINDOW
    return labels


GOOD = wall((3.2, 3.2, 4.0))
PROPORTIONS = row_proportions(GOOD)


def test_each_defect_is_counted_and_a_good_wall_has_none() -> None:
    cases = {
        "good": (GOOD, True),
        "mansard": (wall((3.2, 3.2, 4.0), roof=1.5), True),
        "block": (wall((3.2, 3.2, 4.0), roof=1.5), False),
        "high": (wall((6.4, 3.2, 4.0)), True),
        "low": (wall((2.2, 2.2, 4.0)), True),
        "stretched": (wall((3.2, 3.2, 4.0), window=(1.0, 2.1)), True),
        "blind": (np.full_like(GOOD, FacadeClass.WALL), True),
    }
    found = {
        name: measure_wall(name, "x", labels, DENSITY, PROPORTIONS, {}, has_roof=has_roof)
        for name, (labels, has_roof) in cases.items()
    }
    assert {name: one.defects for name, one in found.items()} == {
        "good": (),
        "mansard": ("roof",),
        "block": (),
        "high": ("storeys",),
        "low": ("storeys",),
        "stretched": ("windows",),
        "blind": ("blind",),
    }
    counts = count_defects(list(found.values()))
    assert (counts["walls"], counts["without_these"], counts["largest_share_of_walls"]) == (7, 2, 1.0)


def test_a_ground_floor_may_be_higher() -> None:
    assert odd_pitches(wall((3.2, 3.2, 6.0)), DENSITY) == ()
    assert odd_pitches(wall((6.6, 3.2, 3.2)), DENSITY) != ()


def test_a_shop_that_is_cut_is_told_from_one_that_is_stretched() -> None:
    exemplar = wall((3.2, 3.2, 4.0))
    exemplar[-30:, 10:60], exemplar[-22:, 70:82] = FacadeClass.SHOP, FacadeClass.DOOR
    proportions = ground_proportions(exemplar)
    assert not are_cut(exemplar, proportions)
    assert not are_cut(np.delete(exemplar, np.s_[20:30], axis=1), proportions)
    assert are_cut(np.delete(exemplar, np.s_[20:45], axis=1), proportions)
    assert not are_cut(GOOD, ground_proportions(GOOD))
