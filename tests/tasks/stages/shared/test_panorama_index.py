"""Choice of the pictures of a lens that a surface is taken from, out of many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.painter.street_truth import SyntheticStreet, synthetic_street
from facade_core.core.arrays import BoolArray
from facade_core.core.types import Lens, Pose
from facade_core.geometry.charts import ChartKind, Charts
from facade_core.geometry.scene import Scene
from facade_core.imagery.panorama_camera import (
    GROUND_REACH_M,
    WALL_REACH_M,
    camera_position,
    is_in_view,
    project_directions_to_picture,
)
from tasks.stages.shared.panorama_index import (
    MAX_PANORAMAS_PER_SURFACE,
    MAX_PICTURES_PER_GROUND,
    VIEW_SHARES,
    UsablePanoramaIndex,
)
from tasks.stages.shared.surface_panorama import SurfacePanorama

LENS = Lens((640, 480), (480.0, 480.0), (320.0, 240.0))


def pictures_of_both_sides(street: SyntheticStreet, count: int) -> list[Pose]:
    """Pictures along a street, each of the side across."""
    poses = []
    for number in range(count):
        side = 1 if number % 2 else -1
        east, north = street.world_point((number + 0.5) / count * street.length, -3.0 * side).tolist()
        across = street.axis[::-1] * [-1, 1] * side
        turn = 35.0 * np.sin(number)
        poses.append(Pose(east, north, 2.0, float(np.degrees(np.arctan2(*across)) + turn), 4.0, lens=LENS))
    return poses


def index_poses(poses: Sequence[Pose]) -> UsablePanoramaIndex:
    every = tuple(SurfacePanorama(Path(f"{n:03}.jpg"), pose, (1.0, 1.0, 1.0), ()) for n, pose in enumerate(poses))
    return UsablePanoramaIndex(every)


def shown_points(charts: Charts, chart: int, poses: Sequence[Pose], reach: float) -> BoolArray:
    """Whether some pictures have each point of a chart in view, within a reach."""
    points = charts.points_at_shares(np.array([chart]), VIEW_SHARES)[0]
    shown = np.zeros(len(points), bool)
    for pose in poses:
        rays = points - camera_position(pose)
        near = np.linalg.norm(rays, axis=1) <= reach
        shown |= near & is_in_view(project_directions_to_picture(rays, pose), pose)
    return shown


def test_of_many_pictures_those_are_taken_that_show_all_that_any_shows() -> None:
    street = synthetic_street(2, seed=3, occluders=0, texels_per_metre=8.0)
    poses, scene = pictures_of_both_sides(street, 60), street.scene
    index = index_poses(poses)
    grounds = np.flatnonzero(scene.charts.kind == ChartKind.GROUND).tolist()
    shares, counts = [], []
    for chart in grounds:
        taken = [one.pose for one in index.near(scene.charts, [chart], GROUND_REACH_M)]
        counts.append(len(taken))
        by_all = shown_points(scene.charts, chart, poses, GROUND_REACH_M)
        by_taken = shown_points(scene.charts, chart, taken, GROUND_REACH_M)
        shares += [by_taken.sum() / by_all.sum()] if by_all.any() else []
    assert min(shares) == 1.0
    assert max(counts) > MAX_PANORAMAS_PER_SURFACE, "as many as it takes"
    assert max(counts) <= MAX_PICTURES_PER_GROUND
    for chart in street.charts:
        taken = [one.pose for one in index.facing(scene.charts, chart)]
        assert len(taken) == MAX_PANORAMAS_PER_SURFACE
        by_all = shown_points(scene.charts, chart, poses, WALL_REACH_M)
        assert shown_points(scene.charts, chart, taken, WALL_REACH_M).sum() > 0.9 * by_all.sum()


def test_panoramas_are_taken_by_their_distance() -> None:
    street = synthetic_street(2, seed=3, occluders=0, texels_per_metre=8.0)
    poses = [replace(pose, lens=None) for pose in pictures_of_both_sides(street, 40)]
    chart = _ground_below(street.scene, poses[20])
    taken = index_poses(poses).near(street.scene.charts, [chart], GROUND_REACH_M)
    corners = street.scene.charts.points_at_shares(np.array([chart]), np.array([[0.5, 0.5]]))[0, 0]
    away = np.array([np.hypot(pose.x - corners[0], pose.y - corners[1]) for pose in poses])
    nearest = sorted(np.argsort(away)[:MAX_PANORAMAS_PER_SURFACE].tolist())
    assert [int(one.path.stem) for one in taken] == nearest


def test_aerial_pictures_are_taken_from_farther_than_pictures_of_the_street() -> None:
    street = synthetic_street(2, seed=3, occluders=0, texels_per_metre=8.0)
    middle = street.world_point(street.length / 2, 0.0)
    chart = _ground_below(street.scene, Pose(*middle.tolist(), 2.0, 0.0))
    sharp = Lens((6000, 4000), (5000.0, 5000.0), (3000.0, 2000.0))
    south = middle - np.array([0.0, 70.0])
    air = Pose(*south.tolist(), 70.0, 0.0, -45.0, lens=sharp)
    low = replace(air, z=2.0, pitch=0.0)
    index = index_poses([air, low])
    assert [one.pose for one in index.near(street.scene.charts, [chart], GROUND_REACH_M)] == [air]


def _ground_below(scene: Scene, pose: Pose) -> int:
    place = camera_position(pose)
    return int(scene.caster.cast(place, np.array([[0.0, 0.0, -1.0]]))[1][0])
