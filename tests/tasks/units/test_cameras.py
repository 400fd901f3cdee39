"""What hides surfaces on a panorama is looked for once, and kept in bits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tasks.units.shown.cameras as module
from facade_core.types import Pose
from tasks.units.imagery import Taken


def test_a_panorama_is_looked_at_once_and_again_when_it_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked = []

    def in_the_way(image: np.ndarray, pose: Pose) -> np.ndarray:
        looked.append(pose)
        return image[..., 0] > 128

    monkeypatch.setattr(module, "_LOOKED_AT", type(module._LOOKED_AT)())
    image = np.random.default_rng(0).integers(0, 255, (37, 75, 3), np.uint8)
    path = tmp_path / "a, b.jpg"
    path.write_bytes(b"a picture")
    one = Taken(path, Pose(0, 0, 2.5, 0), (1.0, 1.0, 1.0), ())
    for _ in range(2):
        np.testing.assert_array_equal(module._hidden(one, image, in_the_way), image[..., 0] > 128)
    assert len(looked) == 1
    path.write_bytes(b"another picture")
    module._hidden(one, image, in_the_way)
    assert len(looked) == 2
    for heading in range(1, 2 + module.KEPT):
        module._hidden(one._replace(pose=Pose(0, 0, 2.5, heading)), image, in_the_way)
    assert len(module._LOOKED_AT) == module.KEPT
