"""Depths inside an outline, and the regions that its edges' slabs are lowest in."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from facade_core.core.errors import GeometryError
from facade_core.geometry.buildings.straight_skeleton import edge_slabs

COURT = shapely.Polygon([(0, 0), (30, 0), (30, 20), (0, 20)], [[(10, 6), (10, 14), (20, 14), (20, 6)]])
U = shapely.Polygon([(0, 0), (30, 0), (32, 25), (20, 26), (20, 11), (11, 11), (10, 30), (0, 30)])
STAR = shapely.Polygon([(0, 0), (10, 4), (20, 0), (16, 10), (22, 20), (11, 15), (0, 22), (5, 10)])


@pytest.mark.parametrize("outline", [COURT, U, STAR])
def test_faces_share_out_the_outline_and_agree_with_the_depths(outline: shapely.Polygon) -> None:
    slabs = edge_slabs(outline)
    faces = slabs.faces(50.0)
    assert shapely.area(faces).sum() == pytest.approx(outline.area, abs=1e-6)
    assert shapely.union_all(faces).area == pytest.approx(outline.area, abs=1e-6)
    inside = shapely.point_on_surface(faces)
    own = shapely.get_coordinates(inside)
    depth = np.einsum("ij,ij->i", own - slabs.start, slabs.inward)
    assert slabs.depth(own) == pytest.approx(depth, abs=1e-6)


@pytest.mark.parametrize("outline", [COURT, U, STAR])
def test_depths_are_continuous_and_at_least_the_wavefronts(outline: shapely.Polygon) -> None:
    slabs = edge_slabs(outline)
    rng = np.random.default_rng(0)
    low, high = np.reshape(outline.bounds, (2, 2))
    points = rng.uniform(low, high, (4000, 2))
    points = points[shapely.contains_xy(outline, points)]
    depth = slabs.depth(points)
    # at reflex corners the mitred front runs ahead of the circle
    assert (depth <= shapely.distance(outline.boundary, shapely.points(points)) + 1e-9).all()
    near = points + rng.normal(0, 1e-3, points.shape)
    near_depth = slabs.depth(near)
    inside = shapely.contains_xy(outline, near)
    assert np.abs(near_depth - depth)[inside].max() < 0.02


def test_an_offset_with_mitred_corners_is_a_contour() -> None:
    for depth in (1.0, 2.5):
        ring = shapely.segmentize(COURT.buffer(-depth, join_style="mitre").boundary, 0.5)
        assert edge_slabs(COURT).depth(shapely.get_coordinates(ring)) == pytest.approx(depth, abs=1e-6)


def test_a_spike_is_refused() -> None:
    spike = shapely.Polygon([(0, 0), (20, 0), (20, 10), (10.001, 10), (10, 0.5), (9.999, 10), (0, 10)])
    with pytest.raises(GeometryError, match="spike"):
        edge_slabs(spike)
