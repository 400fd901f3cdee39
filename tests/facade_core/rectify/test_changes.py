"""What changed on a painted wall, and what only looks so."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.painter.facade import paint_facade as paint
from facade_core.core.errors import ImageError
from facade_core.imagery.rectify.change_detection import detect_changes
from facade_core.imagery.rectify.fusion import ChartView

DENSITY = 1 / 0.05
WALL = paint((14.0, 12.0), floors=4, columns=5, style="jugend", metres_per_pixel=0.05, seed=2).image
OTHER = paint((14.0, 12.0), floors=3, columns=4, style="functionalist", metres_per_pixel=0.05, seed=7).image
SHAPE = WALL.shape[:2]


def view(rgb: np.ndarray, *, seen: np.ndarray | None = None, occluded: np.ndarray | None = None) -> ChartView:
    seen = np.ones(SHAPE, bool) if seen is None else seen
    return ChartView(np.clip(rgb, 0, 255).astype(np.uint8), seen, np.full(SHAPE, 0.8, np.float32), occluded)


def taken(rgb: np.ndarray) -> np.ndarray:
    """On another day: darker and warmer, half in the shade, 20 cm beside, softer."""
    import cv2

    shown = rgb * np.array([0.75, 0.7, 0.62])
    shown[:, : SHAPE[1] // 2] *= 0.6
    return cv2.GaussianBlur(np.roll(shown, (2, 4), (0, 1)), (0, 0), 1.2)


def test_light_shade_pose_and_blur_are_no_change() -> None:
    told = detect_changes(view(taken(WALL)), view(WALL), DENSITY)
    assert told.changed_share is not None
    assert told.changed_share < 0.05
    assert told.compared_share > 0.9
    assert detect_changes(view(WALL), view(WALL), DENSITY).changed_share == 0


@pytest.mark.parametrize("rows", [(0.0, 0.5), (0.7, 1.0), (0.0, 1.0)])
def test_another_wall_is_told_by_the_share_that_it_takes(rows: tuple[float, float]) -> None:
    top, bottom = (round(share * SHAPE[0]) for share in rows)
    now = WALL.copy()
    now[top:bottom] = OTHER[top:bottom]
    told = detect_changes(view(taken(now)), view(WALL), DENSITY)
    assert told.changed_share == pytest.approx(rows[1] - rows[0], abs=0.12)
    assert told.is_changed[top:bottom].mean() > 0.8
    assert (
        told.is_changed[: max(0, top - 12)].sum() + told.is_changed[bottom + 12 :].sum() < 0.05 * told.is_changed.size
    )


def test_paint_is_a_change_and_white_balance_is_none() -> None:
    painted = WALL * np.array([1.0, 0.6, 0.5])
    assert detect_changes(view(taken(painted)), view(WALL), DENSITY).changed_share > 0.5  # type: ignore[operator]
    assert detect_changes(view(WALL * np.array([0.94, 0.88, 1.0])), view(WALL), DENSITY).changed_share < 0.02  # type: ignore[operator]


def test_what_stands_before_it_or_is_not_seen_is_not_compared() -> None:
    tree = np.zeros(SHAPE, bool)
    tree[100:, 40:140] = True
    now = WALL.copy()
    now[tree] = (60, 110, 50)
    unseen = np.ones(SHAPE, bool)
    unseen[:40] = False
    told = detect_changes(view(now, occluded=tree), view(WALL * unseen[..., None], seen=unseen), DENSITY)
    assert told.changed_share == 0
    assert told.compared_share == pytest.approx(1 - (tree | ~unseen).mean(), abs=0.03)
    assert not told.is_changed.any()


def test_too_little_tells_nothing() -> None:
    seen = np.zeros(SHAPE, bool)
    seen[:20] = True
    told = detect_changes(view(OTHER, seen=seen), view(WALL), DENSITY)
    assert told.changed_share is None
    assert 0 < told.compared_share < 0.1
    assert detect_changes(view(OTHER, seen=~seen & False), view(WALL), DENSITY).compared_share == 0


def test_views_of_two_sizes_are_refused() -> None:
    small = ChartView(WALL[:50, :50], np.ones((50, 50), bool), np.ones((50, 50), np.float32))
    with pytest.raises(ImageError, match="differ in size"):
        detect_changes(small, view(WALL), DENSITY)
