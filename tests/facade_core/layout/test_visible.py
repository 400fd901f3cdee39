import numpy as np
import pytest

from facade_core.core.types import Element
from facade_core.facade.layout.visible_region import (
    dilate_hidden_by_window,
    is_middle_hidden,
    visible_region_boxes,
)


def test_visible_boxes_leave_out_the_holes() -> None:
    hidden = np.zeros((40, 60), bool)
    hidden[10:20, 30:50] = True
    boxes = visible_region_boxes(hidden)
    drawn = np.zeros_like(hidden)
    for x0, y0, x1, y1 in boxes:
        assert not drawn[int(y0) : int(y1), int(x0) : int(x1)].any()
        drawn[int(y0) : int(y1), int(x0) : int(x1)] = True
    np.testing.assert_array_equal(drawn, ~hidden)


def test_inside_a_hidden_frame_is_visible_and_specks_cost_little() -> None:
    hidden = np.ones((400, 300), bool)
    hidden[6:-6, 6:-6] = False
    (inside,) = visible_region_boxes(hidden)
    assert inside == (6, 6, 294, 393)  # whole cells of three pixels
    random = np.random.default_rng(0)
    hidden = np.zeros((1200, 900), bool)
    for y, x in random.integers(0, (1190, 890), (150, 2)):
        hidden[y : y + 9, x : x + 9] = True
    boxes = visible_region_boxes(hidden)
    assert len(boxes) < 1000
    drawn = np.zeros_like(hidden)
    for x0, y0, x1, y1 in boxes:
        drawn[int(y0) : int(y1), int(x0) : int(x1)] = True
    assert not (drawn & hidden).any()
    assert drawn.sum() > 0.9 * (~hidden).sum()


def test_a_hole_reaches_half_a_window_out_and_none_where_no_window_is_known() -> None:
    hidden = np.zeros((60, 80), bool)
    hidden[30, 40] = True
    grown = dilate_hidden_by_window(hidden, [Element("window", 0, 0, 8, 12), Element("door", 0, 0, 40, 40)])
    assert grown.sum() == 9 * 13
    assert grown[24, 36]
    assert dilate_hidden_by_window(hidden, []) is hidden


@pytest.mark.parametrize(
    ("region", "expected"),
    [
        ([(10, 20, 40, 60), (70, 20, 110, 60)], True),
        ([(10, 40, 40, 60), (70, 20, 110, 40)], True),  # a half of the height is visible beside
        ([(10, 20, 50, 60), (60, 20, 110, 60)], False),  # a narrow strip
        ([(10, 20, 40, 60), (40, 20, 70, 24), (70, 20, 110, 60)], False),  # not from top to bottom
        ([(10, 20, 60, 60)], False),
        ([(10, 20, 40, 30), (70, 20, 110, 30)], False),  # too little beside
        ([], False),
    ],
)
def test_hidden_strip_between_two_visible_parts(region: list[tuple[int, int, int, int]], expected: bool) -> None:
    assert is_middle_hidden(np.array(region, float).reshape(-1, 4), (10, 20, 110, 60)) is expected
