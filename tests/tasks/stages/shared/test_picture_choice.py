"""Choice of the pictures of a lens whose poses are refined."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace as Value
from typing import Any

import numpy as np

from benchmarks.painter.street_truth import SyntheticStreet, synthetic_street
from facade_core.core.types import Pose
from facade_core.geometry.charts import ChartKind
from facade_core.imagery.panorama_camera import GROUND_REACH_M, WALL_REACH_M
from tasks.stages.shared.captures import MAX_PANORAMAS
from tasks.stages.shared.picture_choice import choose_pictures
from tests.tasks.stages.shared.test_panorama_index import pictures_of_both_sides, shown_points


def street_plan(street: SyntheticStreet, poses: list[Pose], shown: list[list[int]]) -> tuple[Any, Any]:
    """Plan and block of a street: its ground, the fronts as walls, and facades with the pictures that show each."""
    grounds = np.flatnonzero(street.scene.charts.kind == ChartKind.GROUND)
    plan = Value(
        scene=street.scene,
        poses=tuple(poses),
        facades=shown,
        sightings=Value(panoramas_showing=lambda facade: np.array(shown[facade], np.int32)),
        ground_near_cameras=lambda: grounds,
        walls_near_cameras=lambda: {0: list(street.charts)},
    )
    return plan, Value(panoramas=tuple(Value(path=f"{n:03}.jpg", captured=None) for n in range(len(poses))))


def test_of_many_pictures_those_are_refined_that_a_surface_is_taken_from() -> None:
    street = synthetic_street(2, seed=3, occluders=0, texels_per_metre=8.0)
    poses = pictures_of_both_sides(street, 120)
    chosen = choose_pictures(*street_plan(street, poses, [list(range(50, 70))]))
    assert set(range(50, 50 + MAX_PANORAMAS)) <= chosen
    assert len(chosen) < 60
    charts, kept = street.scene.charts, [poses[number] for number in sorted(chosen)]
    for chart in np.flatnonzero(charts.kind == ChartKind.GROUND).tolist():
        by_all = shown_points(charts, chart, poses, GROUND_REACH_M)
        assert shown_points(charts, chart, kept, GROUND_REACH_M).sum() == by_all.sum()
    for chart in street.charts:
        by_all = shown_points(charts, chart, poses, WALL_REACH_M)
        assert shown_points(charts, chart, kept, WALL_REACH_M).sum() > 0.95 * by_all.sum()


def test_panoramas_are_all_refined() -> None:
    street = synthetic_street(2, seed=3, occluders=0, texels_per_metre=8.0)
    poses = pictures_of_both_sides(street, 30)
    away = replace(poses[3], heading=poses[3].heading, pitch=80.0)
    mixed = [*(replace(pose, lens=None) for pose in poses), away]
    assert choose_pictures(*street_plan(street, mixed, [])) == frozenset(range(30))
