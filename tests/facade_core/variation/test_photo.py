import numpy as np

from facade_core.types import Element
from facade_core.variation import encode, exchange_in_photo


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
    hierarchy = encode(image, elements)
    made = exchange_in_photo(image, hierarchy, len(hierarchy.levels) - 1, 1)
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
    hierarchy = encode(image, elements)
    made = exchange_in_photo(image, hierarchy, len(hierarchy.levels) - 1, 1)
    assert not np.array_equal(made, image)
    for e in elements:
        head = made[int(e.y0) + 1 : int(e.y0) + 5, int(e.x0) + 1 : int(e.x0) + 4].mean()
        assert (head > 170) == (e.y0 == 20)
