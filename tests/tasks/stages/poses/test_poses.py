"""Whose heights are mended by roofs, and whose are held."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import shapely

from facade_core.core.types import Building, Pose
from tasks.stages.poses.stage import ground_height_preferred_flags


def block(*poses: Pose, source: str) -> Any:
    houses = [
        Building(source, shapely.box(0, 0, 10, 10), 9.0, source),
        Building("far", shapely.box(900, 0, 910, 9), 9, "default"),
    ]
    return cast(Any, SimpleNamespace(buildings=houses, panoramas=[SimpleNamespace(pose=pose) for pose in poses]))


def test_a_height_is_carried_without_a_stated_one_and_near_roofs_that_are_guessed() -> None:
    stated, without, beyond = Pose(30.0, 5.0, 2.0, 0.0), Pose(30.0, 5.0, None, 0.0), Pose(300.0, 5.0, 2.0, 0.0)
    assert ground_height_preferred_flags(block(stated, without, beyond, source="height")) == [False, True, False]
    assert ground_height_preferred_flags(block(stated, without, beyond, source="model")) == [False, True, False]
    assert ground_height_preferred_flags(block(stated, without, beyond, source="levels")) == [True, True, False]
    assert ground_height_preferred_flags(block(source="levels")) == []
    empty = SimpleNamespace(buildings=[], panoramas=[SimpleNamespace(pose=stated)])
    assert ground_height_preferred_flags(cast(Any, empty)) == [False]
