"""Perspective views of a painted panorama."""

from __future__ import annotations

import numpy as np

from facade_core.imagery.rectify.panorama_views import FIELD_OF_VIEW_DEG, VIEW_COUNT, VIEW_PITCH_DEG, cut_panorama_views


def paint_panorama(width: int = 1024) -> np.ndarray:
    """A panorama whose red is the longitude and whose green is the latitude."""
    longitude, latitude = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(width // 2) + 0.5) / (width // 2))
    return np.rint(np.dstack([255 * longitude, 255 * latitude, 0 * latitude])).astype(np.uint8)


def test_views_look_around_and_up() -> None:
    views = list(cut_panorama_views(paint_panorama()))
    assert len(views) == VIEW_COUNT
    for view in views:
        rows, columns = view.image.shape[:2]
        red, green, _, alpha = view.image[rows // 2, columns // 2].tolist()
        assert abs((red / 255 - 0.5 - view.heading / 360 + 0.5) % 1.0 - 0.5) < 0.01
        assert abs(green / 255 - (0.5 - VIEW_PITCH_DEG / 180)) < 0.01
        assert alpha == 255
        assert np.isclose(np.degrees(2 * np.arctan(columns / 2 / view.focal)), FIELD_OF_VIEW_DEG)
        assert np.isclose(view.focal, 1024 / (2 * np.pi), rtol=0.01)  # the panorama's own resolution


def test_what_a_part_of_a_panorama_lacks_is_hidden() -> None:
    half = paint_panorama()[:, 512:]  # the right half of the circle
    views = {view.heading: view.image for view in cut_panorama_views(half, (0.5, 0.0, 0.5, 1.0))}
    assert 270.0 not in views
    assert (views[90.0][..., 3] == 255).all()
    ahead = views[0.0]
    assert (ahead[:, 2 * ahead.shape[1] // 3 :, 3] == 255).all()
    assert (ahead[:, : ahead.shape[1] // 3, 3] == 0).all()
