"""The variation paper's file: wall, PCA axes of each group of elements, and coordinates of each element (section 4)."""

from __future__ import annotations

import io
import json
import zipfile

import numpy as np
import pytest

from benchmarks.papers.variation_codec import papers_file
from facade_core.core.types import Element
from facade_core.facade.variation.variations import find_variations

STEP, SIZE = 40, (16, 20)


@pytest.fixture(scope="module")
def facade() -> tuple[np.ndarray, list[Element]]:
    """Three floors of four windows of two looks on a plain wall."""
    image = np.full((3 * STEP, 4 * STEP, 3), 180, np.uint8)
    elements = []
    for number in range(12):
        y, x = 10 + STEP * (number // 4), 12 + STEP * (number % 4)
        image[y : y + SIZE[1], x : x + SIZE[0]] = (60, 70, 90) if number % 2 else (220, 210, 160)
        elements.append(Element("window", x, y, x + SIZE[0], y + SIZE[1]))
    return image, elements


def test_a_file_holds_the_wall_the_axes_and_an_entry_for_each_element(facade) -> None:
    image, elements = facade
    of = find_variations(image, elements)
    made = papers_file(image, of)
    with zipfile.ZipFile(io.BytesIO(made.coded)) as archive:
        header = json.loads(archive.read("header.json"))
        assert sorted(archive.namelist()) == sorted(
            ["header.json", *(f"{k}.webp" for k in range(len(header["groups"]) + 1))]
        )
    entries = [len(group["boxes"]) for group in header["groups"]]
    assert sum(entries) == len(elements)
    for group in header["groups"]:
        assert len(group["coordinates"]) == len(group["types"]) == len(group["light"]) == len(group["boxes"])
        axes = {len(coordinates) for coordinates in group["coordinates"]}
        assert axes == {len(group["scales"])}, "one coordinate an axis"


def test_a_reader_sees_the_facade_again(facade) -> None:
    image, elements = facade
    shown = papers_file(image, find_variations(image, elements)).shown
    assert shown.shape == image.shape
    assert np.abs(shown.astype(int) - image).mean() < 6
