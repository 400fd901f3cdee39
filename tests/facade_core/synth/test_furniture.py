"""Cars, trees and people along a street, and facades as relief."""

from __future__ import annotations

import numpy as np
import shapely

from facade_core.core.labels import FacadeClass
from facade_core.synth.furniture import build_street_occluders
from facade_core.synth.model_relief import render_facade_relief

LINE = shapely.LineString([(100, 200), (160, 230)])


def test_furniture_stands_on_the_ground_beside_the_carriageway() -> None:
    mesh = build_street_occluders(LINE, lambda points: 5 + 0.1 * points[:, 0], seed=1)
    assert mesh is not None
    ground = 5 + 0.1 * mesh.vertices[:, 0]
    assert (mesh.vertices[:, 2] > ground - 0.6).all()
    assert (mesh.vertices[:, 2] < ground + 9).all()
    aside = shapely.distance(LINE, shapely.points(mesh.vertices[:, :2]))
    assert aside.min() > 1.5
    assert aside.max() < 12
    again = build_street_occluders(LINE, lambda points: 5 + 0.1 * points[:, 0], seed=1)
    assert again is not None
    np.testing.assert_array_equal(mesh.vertices, again.vertices)


def test_a_street_of_a_metre_has_none() -> None:
    assert (
        build_street_occluders(shapely.LineString([(0, 0), (1, 0)]), lambda points: np.zeros(len(points)), seed=1)
        is None
    )


def test_openings_are_darker_than_the_wall_with_a_shadow_under_their_head_and_a_lit_sill() -> None:
    labels = np.full((60, 40), FacadeClass.WALL, np.uint8)
    labels[10:30, 10:20] = FacadeClass.WINDOW
    labels[40:60, 25:35] = FacadeClass.DOOR
    grey = render_facade_relief(labels, 0.05).astype(int)
    assert grey[20, 15] < grey[5, 5]
    assert grey[10, 15] < grey[20, 15]
    assert grey[31, 15] > grey[5, 5]
    assert grey[50, 30] < grey[50, 5]
