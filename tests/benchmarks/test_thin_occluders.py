from __future__ import annotations

import numpy as np
import pytest

from benchmarks.painter.thin_occluders import THIN_KINDS
from benchmarks.thin_occluders import estimate_metres_per_pixel, measure_drawn, recall
from facade_core.core.labels import FacadeClass
from training.datasets.facades import LabelledFacade


def facade() -> LabelledFacade:
    labels = np.full((400, 300), FacadeClass.WALL, np.uint8)
    for y in (50, 150, 250):
        labels[y : y + 46, 60:106] = labels[y : y + 46, 180:226] = FacadeClass.WINDOW
    image = np.full((400, 300, 3), 190, np.uint8)
    possible = np.left_shift(1, labels).astype(np.uint8)
    return LabelledFacade("plain", image, labels, possible, np.zeros_like(labels), np.zeros_like(labels))


def test_the_scale_is_read_from_windows() -> None:
    assert estimate_metres_per_pixel(facade().possible) == pytest.approx(1.15 / 46)
    assert estimate_metres_per_pixel(np.full((400, 300), 1 << FacadeClass.WALL, np.uint8)) == pytest.approx(14 / 400)


def test_recall_is_of_the_drawn_pixels() -> None:
    sheet: list[np.ndarray] = []
    plain = facade()
    exact = measure_drawn([plain, plain], lambda image: (image != plain.image).any(2), sheet)
    assert exact.keys() == THIN_KINDS.keys()
    assert len(sheet) == len(THIN_KINDS)
    assert all(kind["found"] == 1 for name, kind in exact.items() if name not in ("fence", "scaffold"))  # of gaps too
    nothing = measure_drawn([plain], lambda image: np.zeros(image.shape[:2], bool), [])
    assert {kind["recall"] for kind in nothing.values()} == {0}
    assert recall([(10, 10), (4, 10)]) == {"recall": 0.7, "found": 0.5, "occluders": 2}
