"""Which elements a sample exchanges: none between heads that differ, none between floors."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.painter.facade import paint_facade
from facade_core.core.types import Element
from facade_core.facade.variation.encoding import encode
from facade_core.facade.variation.enlargement import enlarge_facade
from facade_core.facade.variation.exchange import find_arched_heads
from facade_core.facade.variation.hierarchy import Hierarchy
from facade_core.facade.variation.photo_exchange import permute_photo_elements
from facade_core.facade.variation.rendering import element_boxes
from facade_core.facade.variation.sampling import assign_elements_by_type, permute_within_types
from facade_core.facade.variation.variations import find_variations

WALL = 190


def paint_mixed_rows() -> tuple[np.ndarray, list[Element], np.ndarray]:
    """Three rows of windows of one kind; every other one of the middle row has a round head."""
    rng = np.random.default_rng(0)
    image = np.full((200, 400, 3), WALL, np.uint8)
    elements, arched = [], []
    for y in (20, 80, 140):
        for number, x in enumerate(range(20, 380, 40)):
            image[y : y + 30, x : x + 20] = rng.integers(60, 140, 3)
            arched.append(y == 80 and number % 2 == 0)
            if arched[-1]:
                image[y : y + 6, [*range(x, x + 5), *range(x + 15, x + 20)]] = WALL
            elements.append(Element("window", x, y, x + 20, y + 30))
    return image, elements, np.array(arched)


def count_crossings(hierarchy: Hierarchy, kind: np.ndarray) -> tuple[int, int]:
    """Count, over ten samples of the last level, exchanged elements and those of them that differ in kind."""
    classes = hierarchy.exchange_classes(len(hierarchy.levels) - 1)
    places = np.arange(len(classes))
    samples = [permute_within_types(classes, seed) for seed in range(10)]
    return (
        sum(int((shown != places).sum()) for shown in samples),
        sum(int((kind[shown] != kind).sum()) for shown in samples),
    )


def test_round_heads_of_a_mixed_row_change_places_among_themselves() -> None:
    image, elements, arched = paint_mixed_rows()
    hierarchy = encode(image, elements)
    boxes = element_boxes(hierarchy.groups)
    at = {(e.x0, e.y0): bool(round_head) for e, round_head in zip(elements, arched, strict=True)}
    nearest = [min(at, key=lambda corner: abs(corner[0] - x) + abs(corner[1] - y)) for x, y, *_ in boxes.tolist()]
    kind = np.array([at[corner] for corner in nearest])
    assert find_arched_heads(image, boxes).tolist() == kind.tolist()
    exchanged, crossings = count_crossings(hierarchy, kind)
    assert exchanged > 100
    assert crossings == 0
    made, _ = permute_photo_elements(image, find_variations(image, elements), 1, 1)
    assert not np.array_equal(made, image)
    for e, round_head in zip(elements, arched, strict=True):
        head = made[int(e.y0) + 1 : int(e.y0) + 5, int(e.x0) + 1 : int(e.x0) + 4].mean()
        assert (head > 170) == round_head


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_round_heads_of_an_enlarged_facade_stand_in_copies_of_their_places(seed: int) -> None:
    image, elements, _ = paint_mixed_rows()
    hierarchy = encode(image, elements)
    boxes = element_boxes(hierarchy.groups)
    kind = find_arched_heads(image, boxes).astype(int) + 2 * np.unique(boxes[:, 3], return_inverse=True)[1]
    rng = np.random.default_rng(seed)
    larger = enlarge_facade(hierarchy.wall, hierarchy.groups, hierarchy.cells, 5, 12, rng)
    classes = hierarchy.exchange_classes(len(hierarchy.levels) - 1)
    shown = assign_elements_by_type(classes, larger.places, larger.boxes, rng)
    assert len(shown) == 5 * 12
    assert (shown != larger.places).sum() > 15
    assert (kind[shown] == kind[larger.places]).all()


@pytest.mark.parametrize("seed", [0, 11])
def test_no_window_of_a_painted_facade_leaves_its_floor(seed: int) -> None:
    painted = paint_facade((15.0, 14.0), floors=4, columns=6, style="jugend", metres_per_pixel=0.06, seed=seed)
    hierarchy = encode(painted.image, painted.elements)
    boxes = element_boxes(hierarchy.groups)
    feet = np.sort(np.unique(boxes[:, 3]))
    floor = np.searchsorted(feet[1:][np.diff(feet) > 10], boxes[:, 3], side="right")
    assert len(np.unique(floor)) >= 4
    assert find_arched_heads(painted.image, boxes)[floor == 0].mean() > 0.6, "the highest floor has arched windows"
    exchanged, crossings = count_crossings(hierarchy, floor)
    assert exchanged > 20
    assert crossings == 0
    assert not np.array_equal(hierarchy.sample(1, 0), hierarchy.photo)
