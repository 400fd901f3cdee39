"""What the benchmark of side walls and roofs tells of a street of which one kind is out of sight."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import camera_walls


def test_of_a_street_whose_roofs_no_camera_shows_the_walls_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(camera_walls, "mask_building_occluders", lambda image, pose: np.zeros(image.shape[:2], bool))
    found = camera_walls.measure(buildings=2, cameras=1, width=256)
    for poses in ("given", "refined", "true"):
        assert found[poses]["roofs"] is None
        assert found[poses]["walls"]["all"]["share"] == 1
