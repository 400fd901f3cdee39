"""Photos matched to walls: against cameras that are known."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.matching import SIZE, WIDE_DEG, photo_of
from benchmarks.painter.street_truth import SyntheticStreet, synthetic_street
from facade_core.geometry.charts import ChartKind
from facade_core.imagery.poses.photo_matching import (
    PhotoOrientation,
    camera_from_homography,
    estimate_orientation,
    match_walls,
)
from facade_core.imagery.rectify.photo import rectify


@pytest.fixture(scope="module")
def street() -> SyntheticStreet:
    return synthetic_street(8, seed=0, occluders=1, texels_per_metre=14.0)


def walls_of(street: SyntheticStreet) -> np.ndarray:
    charts = street.scene.charts
    return np.flatnonzero((charts.kind == ChartKind.WALL) & (charts.size.min(axis=1) > 3))


def test_a_camera_is_where_it_was() -> None:
    """A plane z = 0 of pixels, seen by a camera that is turned, rolled and tilted."""
    angles = np.radians([12.0, -25.0, 3.0])
    (a, b, c), (d, e, f) = np.cos(angles), np.sin(angles)
    rotation = (
        np.array([[1, 0, 0], [0, a, -d], [0, d, a]])
        @ np.array([[b, 0, e], [0, 1, 0], [-e, 0, b]])
        @ np.array([[c, -f, 0], [f, c, 0], [0, 0, 1]])
    )
    place, focal, size = np.array([400.0, 900.0, -1200.0]), 800.0, (600, 1000)
    intrinsic = np.array([[focal, 0, 499.5], [0, focal, 299.5], [0, 0, 1]])
    from_plane = intrinsic @ np.column_stack([rotation[:, 0], rotation[:, 1], -rotation @ place])
    for scale in (1.0, -3.0):
        found, camera = camera_from_homography(scale * np.linalg.inv(from_plane), focal, size)
        np.testing.assert_allclose(found, rotation, atol=1e-9)
        np.testing.assert_allclose(camera, [400, 900, 1200], atol=1e-6)


@pytest.mark.long
def test_a_photo_tells_whither_it_looks_and_where_the_roof_is(street: SyntheticStreet) -> None:
    chart = street.charts[6]
    photo, place, heading = photo_of(street, chart, np.random.default_rng(3))
    found = rectify(photo, focal=SIZE[1] / 2 / np.tan(np.radians(WIDE_DEG) / 2))
    taken = estimate_orientation(found.image, found.seen, found.homography, found.focal, photo.shape[:2])
    charts = street.scene.charts
    way = taken.ahead[0] * charts.axis_u[chart] - taken.ahead[1] * charts.normals()[chart]
    off = (np.degrees(np.arctan2(way[0], way[1])) - heading + 180) % 360 - 180
    assert abs(off) < 2
    before = (np.append(place, 0.0) - charts.origin[chart]) @ charts.normals()[chart]
    assert taken.roof_slope is not None
    assert taken.roof_slope * before == pytest.approx(charts.size[chart, 1] - 1.65, rel=0.1)


def test_the_wall_is_found_that_the_ray_meets_and_none_behind_others(street: SyntheticStreet) -> None:
    charts, walls = street.scene.charts, walls_of(street)
    for chart in street.charts:
        width, height = charts.size[chart]
        normal = charts.normals()[chart]
        foot = charts.points(chart, np.array([width / 2]), np.array([height]))[0]
        taken = PhotoOrientation(np.array([0.0, 1.0]), (height - 1.65) / 14)
        heading = float(np.degrees(np.arctan2(-normal[0], -normal[1])))
        place = foot + 14 * normal
        found = match_walls(street.scene, walls, taken, place, heading + 7, seed=0)
        likely, best = found.probability, found.probability.argmax()
        assert walls[best] == chart
        assert 0.4 < found.hit_share[best] <= 1
        assert found.heading_offset_deg[best] == pytest.approx(-7)
        assert found.roof_height_m[best] == pytest.approx(height, rel=0.25), (
            "of places that are 5 m off, the middle one"
        )
        assert 0.5 < likely.sum() < 1
        assert likely[~np.isin(walls, street.charts)].max() < 0.01, "sides and backs do not stand there"
        wrong = PhotoOrientation(taken.ahead, 40 * height / 14)
        assert match_walls(street.scene, walls, wrong, place, heading, seed=0).probability.sum() < 0.1, (
            "no roof is so high"
        )
        assert not match_walls(street.scene, walls, taken, place + 900.0, heading, seed=0).probability.any()
