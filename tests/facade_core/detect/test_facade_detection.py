"""Where and how finely faces and plates are looked for on a facade of known scale; the detectors are the test's."""

from __future__ import annotations

import numpy as np
import pytest

from facade_core.imagery.detect import facade_detection
from facade_core.imagery.detect.facade_detection import detect_on_facade, detect_on_thumbnail
from facade_core.imagery.detect.plates import has_plate_shape

SearchCalls = list[tuple[str, int, float]]


@pytest.fixture
def search_calls(monkeypatch: pytest.MonkeyPatch) -> SearchCalls:
    """Rows and scale of each search, which finds a box in the first row of what it is given."""
    calls: SearchCalls = []

    def find(kind: str, image: np.ndarray, scale: float) -> np.ndarray:
        calls.append((kind, len(image), scale))
        return np.array([[4.0, 0.0, 9.0, 3.0]])

    monkeypatch.setattr(facade_detection, "detectors_available", lambda: True)
    monkeypatch.setattr(facade_detection, "find_faces_at_scale", lambda image, scale: find("faces", image, scale))
    monkeypatch.setattr(facade_detection, "find_plate_boxes", lambda image, scale: find("plates", image, scale))
    return calls


def test_the_foot_is_searched_enlarged_and_boxes_are_those_of_the_picture(search_calls: SearchCalls) -> None:
    found = detect_on_facade(np.zeros((400, 300, 3), np.uint8), 1 / 25)
    assert search_calls == [("faces", 125, 2.0), ("faces", 125, 4.0), ("plates", 75, 3.0)]
    assert found.faces.tolist() == [[4, 275, 9, 278]] * 2, "of both scales"
    assert found.plates.tolist() == [[4, 325, 9, 328]]


def test_a_fine_picture_is_searched_whole_for_faces_and_no_finer_than_needed(search_calls: SearchCalls) -> None:
    detect_on_facade(np.zeros((2000, 300, 3), np.uint8), 1 / 160)
    assert search_calls == [
        ("faces", 800, 0.5),
        ("faces", 800, 1.0),
        ("faces", 1200, 0.5),
        ("faces", 1200, 1.0),
        ("plates", 480, 1.0),
    ]


def test_a_large_part_is_searched_for_faces_at_one_scale(search_calls: SearchCalls) -> None:
    detect_on_facade(np.zeros((1500, 1500, 3), np.uint8), 1 / 80)
    assert search_calls == [("faces", 400, 1.0), ("faces", 400, 2.0), ("faces", 1100, 1.0), ("plates", 240, 145 / 80)]


def test_a_low_facade_is_searched_to_its_top(search_calls: SearchCalls) -> None:
    detect_on_facade(np.zeros((50, 300, 3), np.uint8), 1 / 25)
    assert [rows for _, rows, _ in search_calls] == [50, 50, 50]


def test_a_thumbnail_is_searched_for_plates_in_its_lower_half(search_calls: SearchCalls) -> None:
    found = detect_on_thumbnail(np.zeros((240, 180, 3), np.uint8))
    assert [rows for _, rows, _ in search_calls] == [120, 240]
    assert found.plates.tolist() == [[4, 120, 9, 123]]
    assert len(found.faces) == 1


@pytest.mark.parametrize(("length", "is_plate"), [(94, True), (300, False), (20, False)])
def test_lines_of_other_shapes_are_not_recognised(length: int, *, is_plate: bool) -> None:
    corners = np.array([[0, 0], [length, 0], [length, 20], [0, 20]], float)
    assert has_plate_shape(corners) == is_plate
