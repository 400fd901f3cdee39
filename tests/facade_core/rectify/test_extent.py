"""Extent of a facade by its lines."""

from __future__ import annotations

import numpy as np

from facade_core.imagery.rectify.extent import facade_extent
from facade_core.imagery.rectify.vanishing import FacadeCamera

CORNERS = np.array([[-0.7, -0.7], [0.7, -0.7], [0.7, 0.7], [-0.7, 0.7]])
FLOORS = (-0.3, -0.1, 0.1, 0.3)


def window(x: float, y: float, slope: float = 0.0) -> list[list[list[float]]]:
    """Four lines of a window of 0.08 by 0.12, its level ones with a slope."""
    left, right, top, foot = x - 0.04, x + 0.04, y - 0.06, y + 0.06
    level = [[[left, edge], [right, edge + 0.08 * slope]] for edge in (top, foot)]
    return [*level, *([[edge, top], [edge, foot]] for edge in (left, right))]


def extent(*windows: tuple[float, float, float]) -> tuple[float, float, float, float]:
    """Extent by four floors of four windows on a plane seen from its front, and by others whose level lines slope."""
    lines = [line for y in FLOORS for x in (-0.3, -0.1, 0.1, 0.3) for line in window(x, y)]
    family = [0, 0, 1, 1] * 16
    for x, y, slope in windows:
        lines += window(x, y, slope)
        family += [-1, -1, 1, 1]
    view = FacadeCamera(np.eye(3), 1.0, 0.0, np.array(family, np.int8))
    box = facade_extent(np.array(lines), view, CORNERS)
    assert box is not None
    return box


def test_a_storey_whose_lines_miss_the_vanishing_point_belongs_to_the_facade() -> None:
    storey = [(x, -0.55, 0.05) for x in (-0.3, -0.1, 0.1, 0.3)]
    assert extent()[1] > -0.5
    assert extent(*storey)[1] < -0.61
    steep = [(x, y, 0.12) for x, y, _ in storey]
    assert extent(*steep)[1] > -0.5


def test_such_lines_beside_a_facade_do_not_belong_to_it() -> None:
    beside = [(0.58, y, 0.05) for y in FLOORS]
    assert extent(*beside) == extent()
