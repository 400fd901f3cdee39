"""Heights above the datum, and outlines at the height of roofs."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from catalogs.readers.vectors.absolute_heights import (
    ignore_other_heights,
    mark_gutter_heights,
    note_roof_heights,
    subtract_ground_heights,
)


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


def test_least_heights_of_roofs_are_no_lower_ends() -> None:
    tags = [{"height": "12", "min_height": "10"}, {"height": "9"}]
    assert ignore_other_heights(tags, {"height": "height", "min_height": "min_height"}, "b.gpkg") == []
    (remark,) = ignore_other_heights(tags, {"avg_height": "AVG_HEIGHT", "min_height": "MIN_HEIGHT"}, "b.gpkg")
    assert tags == [{"height": "12"}, {"height": "9"}]
    assert (remark.id, "least heights of b.gpkg" in remark.reason) == ("1 buildings", True)


@pytest.mark.parametrize(
    ("tags", "is_ignored"),
    [
        ([{"roof:height": "14.2"}, {"roof:height": "9.6"}], True),
        ([{"roof:height": "14.2", "building:levels": "4"}], True),
        ([{"roof:height": "4.2"}], False),
        ([{"roof:height": "14.2", "height": "40"}], False),
        ([{"roof:height": "14.2", "roof:shape": "pyramidal"}], False),
    ],
)
def test_roof_heights_from_the_ground_are_no_rises(tags: list[dict[str, str]], is_ignored: bool) -> None:
    assert bool(ignore_other_heights(tags, {}, "b.gpkg")) == is_ignored
    assert any("roof:height" in one for one in tags) != is_ignored


def test_heights_of_the_french_map_reach_to_the_gutter() -> None:
    tags = [{"height": "9"}, {}]
    mark_gutter_heights(tags, {"hauteur": "HAUTEUR"})
    assert tags == [{"height": "9"}, {}]
    mark_gutter_heights(tags, {"hauteur": "HAUTEUR", "z_min_sol": "Z_MIN_SOL"})
    assert tags == [{"height:eaves": "9"}, {}]
