"""A drawn facade with exact labels: sky, roof, floors of windows with sills, a door and a shop on the ground."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from facade_core.core.labels import FacadeClass

FLOOR, BAY = 40, 36


class Drawn(NamedTuple):
    image: np.ndarray
    labels: np.ndarray


def draw(floors: int = 4, bays: int = 4, *, street: bool = True, grain: float = 3.0) -> Drawn:
    top, ground = 30, 50 if street else 0
    height, width = top + floors * FLOOR + ground, bays * BAY
    labels = np.full((height, width), FacadeClass.WALL, np.uint8)
    labels[:10] = FacadeClass.SKY
    labels[10:top] = FacadeClass.ROOF
    for f in range(floors):
        for b in range(bays):
            y, x = top + f * FLOOR + 10, b * BAY + 10
            labels[y : y + 20, x : x + 16] = FacadeClass.WINDOW
            labels[y + 20 : y + 25, x - 2 : x + 18] = FacadeClass.BALCONY
    if street:
        labels[height - 36 :, 8:24] = FacadeClass.DOOR
        labels[height - 40 :, BAY + 6 : width - 4] = FacadeClass.SHOP
    colours = np.array(
        [[200, 180, 150], [60, 80, 110], [90, 90, 90], [140, 80, 40], [90, 100, 120], [60, 140, 90], [190, 220, 250]]
    )
    noise = np.random.default_rng(0).normal(0.0, grain, (*labels.shape, 3))
    return Drawn(np.clip(colours[labels] + noise, 0, 255).astype(np.uint8), labels)


@pytest.fixture(scope="session")
def facade() -> Drawn:
    return draw()
