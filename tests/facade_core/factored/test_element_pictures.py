"""Element pictures of walls against the exemplar that they are from."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import shapely

from facade_core.core.types import Element
from facade_core.export.factored.element_pictures import (
    PICTURE_OFFSET_M,
    collect_element_pictures,
    place_element_pictures,
)
from facade_core.export.factored.library import FacadeLibrary
from facade_core.export.factored.wall_decomposition import StoredFacadeWall
from facade_core.export.factored.wall_geometry import WallPiece, WallPieces, WallPolygon
from facade_core.geometry.charts import Charts

DENSITY, TIMES = 32, 2
WIDTH_M, HEIGHT_M = 8, 6


def painted() -> tuple[np.ndarray, np.ndarray, list[Element]]:
    """A wall with four windows, no two of one colour: stored texels, the original, and the elements."""
    fine = np.full((HEIGHT_M * DENSITY * TIMES, WIDTH_M * DENSITY * TIMES, 3), (190, 170, 140), np.uint8)
    elements = []
    for number in range(4):
        x, y = 32 + 128 * (number % 2), 24 + 88 * (number // 2)
        box = np.s_[TIMES * y : TIMES * (y + 60), TIMES * x : TIMES * (x + 40)]
        fine[box] = (40 + 50 * number, 60 + 30 * number, 200 - 40 * number)
        fine[box][:, ::2] += 20
        elements.append(Element("window", x, y, x + 40, y + 60))
    image = np.asarray(cv2.resize(fine, None, fx=1 / TIMES, fy=1 / TIMES, interpolation=cv2.INTER_AREA), np.uint8)
    return image, fine, elements


def placed(library: FacadeLibrary, base: np.ndarray, colour: np.ndarray, elements: list[Element]) -> WallPieces:
    charts = Charts(
        np.zeros(1, np.int32),
        np.zeros(1, np.int32),
        np.zeros(1, np.int32),
        np.array([[0.0, 0.0, HEIGHT_M]]),
        np.array([[1.0, 0.0, 0.0]]),
        np.array([[0.0, 0.0, -1.0]]),
        np.array([[WIDTH_M, HEIGHT_M]], np.float64),
    )
    corners = np.array([[0, 0, 0], [WIDTH_M, 0, 0], [WIDTH_M, 0, HEIGHT_M], [0, 0, HEIGHT_M]], np.float64)
    polygon = WallPolygon(shapely.box(0, 0, WIDTH_M, HEIGHT_M), corners)
    labels = np.zeros(base.shape[:2], np.uint8)
    pieces = WallPieces()
    wall = StoredFacadeWall(0, base, colour, labels, elements, float(DENSITY))
    place_element_pictures(wall, [polygon], charts, library, 3, pieces)
    return pieces


def by_number(pieces: WallPieces) -> dict[int, WallPiece]:
    assert all(key[:2] == ("type", 3) for key in pieces.by_picture)
    return {key[2]: own[0] for key, own in pieces.by_picture.items()}


def test_every_element_shows_its_own_pixels_in_the_light_of_the_wall() -> None:
    image, fine, elements = painted()
    library = collect_element_pictures(image, fine, elements, DENSITY)
    assert len(library.units) == 4
    dark = (0.5 * image).astype(np.uint8)
    pieces = placed(library, image, dark, elements)
    assert [round(density) for _, density in pieces.elements] == [TIMES * DENSITY] * 4
    for number, piece in by_number(pieces).items():
        picture = library.types[number].picture
        x0, _, x1, y1 = (round(side * DENSITY * TIMES) for side in library.units[number].box)
        np.testing.assert_array_equal(picture, fine[y1 - picture.shape[0] : y1, x0:x1])
        np.testing.assert_allclose(piece.position[:, 1], -PICTURE_OFFSET_M, atol=1e-9)
        np.testing.assert_allclose(np.ptp(piece.position, axis=0)[[0, 2]], library.units[number].size, atol=1e-6)
        # half the grey level of sRGB is about a fifth of the light
        assert ((piece.light > 0.15) & (piece.light < 0.35)).all()
        a, b, c = (piece.position[piece.triangles[:, k]] for k in range(3))
        assert (np.cross(b - a, c - a) @ [0, -1, 0] > 0).all(), "triangles face the street"


def test_only_what_is_stored_as_photographed_and_shown_on_the_wall_has_a_picture() -> None:
    image, fine, elements = painted()
    assert not collect_element_pictures(image, image, elements, DENSITY).units, "an original that is no denser"
    replaced = image.copy()
    box = elements[1]
    replaced[box.y0 : box.y1, box.x0 : box.x0 + 10] = 255  # a person stood there
    library = collect_element_pictures(replaced, fine, elements, DENSITY)
    assert len(library.units) == 3
    whole = collect_element_pictures(image, fine, elements, DENSITY)
    other = image.copy()
    box = elements[2]
    other[box.y0 : box.y1, box.x0 : box.x1] = (255, 255, 0)  # a window that no exemplar has
    assert len(placed(whole, other, other, elements).elements) == 3
    assert not placed(library, image, image, []).elements


@pytest.mark.parametrize("moved", [0, 1])
def test_an_element_takes_the_picture_that_it_shows(moved: int) -> None:
    image, fine, elements = painted()
    library = collect_element_pictures(image, fine, elements, DENSITY)
    base = image.copy()
    one, two = elements[0], elements[3]
    base[one.y0 : one.y1, one.x0 + moved : one.x1 + moved] = image[two.y0 : two.y1, two.x0 : two.x1]
    found = placed(library, base, base, elements)
    counts = {key[2]: len(own) for key, own in found.by_picture.items()}
    assert sorted(counts.values()) == [1, 1, 2], "two windows show one picture"
