"""Pictures of the same painted facade, and of others."""

from __future__ import annotations

import numpy as np

from benchmarks.painter.exemplars import paint_exemplar
from facade_core.imagery.rectify.same_facade import FacadeFeatures, detect_facade_features, show_same_facade

METRES_PER_PIXEL = 0.05


def features(image: np.ndarray, metres_per_pixel: float = METRES_PER_PIXEL) -> FacadeFeatures:
    return detect_facade_features(image, metres_per_pixel)


def test_parts_of_one_facade_in_other_light_and_at_a_wrong_scale_are_the_same() -> None:
    image = paint_exemplar(0, seed=4).image
    width = image.shape[1]
    left = features(np.ascontiguousarray(image[:, : 3 * width // 4]))
    darker = np.clip(0.7 * image[:, width // 4 :], 0, 255).astype(np.uint8)
    assert show_same_facade(left, features(darker))
    assert show_same_facade(left, features(darker, 1.15 * METRES_PER_PIXEL))


def test_other_facades_of_one_style_are_others() -> None:
    found = [features(paint_exemplar(index, seed=4, styles=("haussmann",)).image) for index in range(3)]
    assert not any(show_same_facade(found[i], found[k]) for i in range(3) for k in range(i))


def test_a_picture_without_features_is_the_same_as_none() -> None:
    plain = features(np.full((200, 200, 3), 128, np.uint8))
    assert not show_same_facade(plain, plain)
