"""Heights above the datum, and outlines at the height of roofs."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from catalogs.readers.vectors.absolute_heights import note_roof_heights, subtract_ground_heights


def rows(heights: list[float], grounds: list[float]) -> list[dict[str, str]]:
    return [{"height": str(h), "ground": str(g)} for h, g in zip(heights, grounds, strict=True)]


def test_heights_above_the_datum_become_heights_above_the_ground() -> None:
    tags = [*rows([182.0, 179.0], [170.0, 170.5]), {"building": "yes"}]
    (remark,) = subtract_ground_heights(tags, "b.gpkg")
    assert [float(one["height"]) for one in tags[:2]] == [12.0, 8.5]
    assert "above the datum" in remark.reason


@pytest.mark.parametrize(
    ("heights", "grounds"),
    [([12.0, 9.0], [170.0, 171.0]), ([12.0, 9.0], [2.0, 3.0]), ([182.0], [170.0]), ([182.0, 12.0], [170.0, 170.0])],
)
def test_other_heights_stay(heights: list[float], grounds: list[float]) -> None:
    tags = rows(heights, grounds)
    assert subtract_ground_heights(tags, "b.gpkg") == []
    assert [float(one["height"]) for one in tags] == heights


@pytest.mark.parametrize(
    ("z", "is_noted"), [([182.0, 179.0, 175.0], True), ([170.0, 170.5, 171.0], False), ([170.0, 175.0, 180.0], False)]
)
def test_outlines_at_the_height_of_roofs_are_noted(z: list[float], is_noted: bool) -> None:
    shapes = np.array([shapely.force_3d(shapely.box(0, 0, 9, 9), one) for one in z], dtype=object)
    tags = [{"height": str(height)} for height in (12.0, 9.0, 5.2)]
    assert bool(note_roof_heights(tags, shapes, "b.gpkg")) == is_noted
