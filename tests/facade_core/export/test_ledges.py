"""Ledges of painted walls, and their bodies."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from facade_core.core.types import Element
from facade_core.export.bodies.ledges import LEDGE_LABEL, detect_ledges, ledge_faces, place_ledges
from facade_core.export.bodies.settings import LEDGES

DENSITY = 32.0


def painted(course: int) -> tuple[np.ndarray, list[Element]]:
    """A wall of 8 by 6 m with a course of a brightness at 3 m, 0.25 m high, over stone, and a window in each part."""
    rng = np.random.default_rng(3)
    image = np.full((192, 256, 3), 150, np.float64)
    image[96:104] = course
    image[104:] = 110
    image += rng.normal(0, 3, image.shape[:2])[..., None]
    elements = [Element("window", 2, 1, 3, 2.5), Element("window", 5, 4, 6, 5.5)]
    for e in elements:
        box = tuple(slice(round(a * DENSITY), round(b * DENSITY)) for a, b in ((e.y0, e.y1), (e.x0, e.x1)))
        image[box] = 40
    return np.clip(image, 0, 255).astype(np.uint8), elements


def test_a_light_course_is_a_ledge_and_a_dark_one_is_none() -> None:
    (found,) = detect_ledges(*painted(220), DENSITY)
    assert (found.label, found.x0, found.x1) == (LEDGE_LABEL, 0, 8)
    assert (found.y0, found.y1) == pytest.approx((3, 3.25), abs=0.05)
    assert detect_ledges(*painted(90), DENSITY) == []
    assert detect_ledges(*painted(150), DENSITY) == [], "what is as light as the wall above"


def test_ledges_end_before_what_crosses_them_and_stay_within_their_wall() -> None:
    wall = shapely.Polygon([(0, 0), (10, 0), (10, 6), (2, 6), (2, 4), (0, 4)])
    ledges = [Element(LEDGE_LABEL, 0, 3, 10, 3.3), Element(LEDGE_LABEL, 0, 4.5, 10, 4.7)]
    found = place_ledges(wall, [*ledges, Element("window", 4, 2, 5, 3.1), Element("balcony", 9.5, 2, 12, 3.2)])
    assert [box.bounds for box in found] == [
        pytest.approx((0, 3, 3.94, 3.3)),
        pytest.approx((5.06, 3, 9.44, 3.3)),
    ], "the second leaves the wall"
    assert place_ledges(wall, [Element(LEDGE_LABEL, 0, 3, 10, 3.02)]) == []


def test_a_ledge_is_a_closed_body_that_faces_outwards() -> None:
    faces = [rings[0] for rings, _, _ in ledge_faces(shapely.box(1, 2, 5, 2.3))]
    edges = [
        (tuple(one), tuple(other)) for ring in faces for one, other in zip(ring, np.roll(ring, -1, axis=0), strict=True)
    ]
    assert len(set(edges)) == len(edges) == 24
    assert {(b, a) for a, b in edges} == set(edges)
    # y runs down: what runs counter-clockwise for the eye has its volume negative in the wall's frame
    volume = sum(float(np.linalg.det([ring[0], ring[k], ring[k + 1]])) / 6 for ring in faces for k in (1, 2))
    assert abs(volume) == pytest.approx(4 * 0.3 * LEDGES.ledge_depth_m)
    front = faces[0]
    assert np.cross(front[1] - front[0], front[2] - front[0])[2] < 0
    assert volume < 0
    for rings, places, _ in ledge_faces(shapely.box(1, 2, 5, 2.3)):
        assert rings[0].shape[0] == places[0].shape[0]
        assert (places[0] >= [1, 2]).all()
        assert (places[0] <= [5, 2.3]).all()
