"""Composite streets: what is rendered without texture is what the truth shows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from facade_core.core.errors import InputError
from tasks.training import composites


@pytest.mark.long
@pytest.mark.realdata
def test_pairs_show_photos_where_walls_are_and_ground_below(data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(composites, "STREET_COUNT", 1)
    monkeypatch.setattr(composites, "BUILDINGS_PER_STREET", 2)
    pairs = composites.render_composites(data, seed=0)
    assert len(pairs) > 2
    for pair in pairs:
        assert pair.image.shape == (512, 1024, 3)
        assert pair.rendering.grey.shape == pair.rendering.textured.shape == pair.valid.shape == (512, 1024)
        assert not pair.valid[pair.rendering.grey == 0].any(), "the sky is not learnt from"
        assert pair.valid[400:].mean() > 0.95, "the ground is"
        # sun and sky stand in no truth: its sky is bright where the rendering has none
        assert pair.image[pair.rendering.grey == 0].mean() > 150 > pair.image[400:].mean()
    again = composites.render_composites(data, seed=0)
    assert all(np.array_equal(a.image, b.image) for a, b in zip(pairs, again, strict=True))


def test_a_folder_without_facades_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=str(tmp_path)):
        composites.render_composites(tmp_path, seed=0)
