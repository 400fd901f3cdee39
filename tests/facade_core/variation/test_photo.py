import numpy as np

from facade_core.core.types import Element
from facade_core.facade.variation.encoding import encode_variations
from facade_core.facade.variation.photo_exchange import permute_photo_elements
from facade_core.facade.variation.variations import find_variations


def test_nothing_burns_out_that_moves_from_beside_a_darker_wall():
    rng = np.random.default_rng(0)
    image = np.full((240, 360, 3), 200, np.uint8)
    image[120:] = 130  # another material: what stands on it is in the same light
    elements = []
    for y in (30, 80, 140, 190):
        for x in range(20, 340, 40):
            image[y : y + 24, x : x + 20] = rng.integers(215, 236)
            image[y + 4 : y + 20, x + 4 : x + 16] = rng.integers(60, 160, 3)
            elements.append(Element("window", x, y, x + 20, y + 24))
    made, _ = permute_photo_elements(image, find_variations(image, elements), 1, 1)
    assert not np.array_equal(made, image)
    assert (made >= 254).mean() < 0.001


def test_a_storey_keeps_its_heads():
    rng = np.random.default_rng(0)
    image = np.full((200, 400, 3), 190, np.uint8)
    elements = []
    for y in (20, 80, 140):
        for x in range(20, 380, 40):
            image[y : y + 30, x : x + 20] = rng.integers(60, 140, 3)
            if y == 20:  # round heads: wall in the corners of the top storey's windows
                image[y : y + 6, [*range(x, x + 5), *range(x + 15, x + 20)]] = 190
            elements.append(Element("window", x, y, x + 20, y + 30))
    made, _ = permute_photo_elements(image, find_variations(image, elements), 1, 1)
    assert not np.array_equal(made, image)
    for e in elements:
        head = made[int(e.y0) + 1 : int(e.y0) + 5, int(e.x0) + 1 : int(e.x0) + 4].mean()
        assert (head > 170) == (e.y0 == 20)


def test_the_variations_of_what_was_exchanged_are_those_of_its_picture():
    rng = np.random.default_rng(0)
    image = np.full((200, 400, 3), 190, np.uint8)
    states = rng.integers(3, size=(3, 9))
    elements = []
    for row, y in enumerate((20, 80, 140)):
        for column, x in enumerate(range(20, 380, 40)):
            image[y : y + 30, x : x + 20] = 60
            image[y : y + (0, 12, 26)[states[row, column]], x : x + 20] = 220
            elements.append(Element("window", x, y, x + 20, y + 30))
    before = find_variations(image, elements)
    made, after = permute_photo_elements(image, before, 1, 3)
    again = find_variations(made, elements)
    assert (before.types != after.types).any()
    np.testing.assert_array_equal(np.sort(before.types), np.sort(after.types))
    pairs = set(zip(after.types.tolist(), again.types.tolist(), strict=True))
    assert len(pairs) == len(set(after.types.tolist())), "types are those that the new picture shows"
    hierarchy = encode_variations(made, after)
    assert (hierarchy.types_at(0) == after.types).all()
    assert after.types[after.representatives].tolist() == list(range(len(after.representatives)))
