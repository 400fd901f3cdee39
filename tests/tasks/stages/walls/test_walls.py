"""Walls and roofs from panoramas: which charts, which panoramas, and what stays of them in a changed block."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace as Value
from typing import Any

import numpy as np
import shapely
import zarr

from catalogs.block.reader import TextureSettings
from facade_core.atlas.journal import write_record
from facade_core.core.types import Building, IngestSettings, Pose, Roof, Street
from facade_core.geometry.charts import ChartKind
from facade_core.plan.ingest import BlockInputs, build_plan
from facade_core.plan.plan import Plan
from facade_core.plan.posed_pictures import replace_panoramas
from tasks.engine.store.carry_over import match_units
from tasks.engine.unit import Unit
from tasks.stages.order import STAGE_NAMES
from tasks.stages.shared.panorama_index import MAX_PANORAMAS_PER_SURFACE, MAX_PIECE_M
from tasks.stages.walls.stage import WALLS, list_wall_units
from tasks.stages.walls.worker import WallInputs
from tests.keys import differing_inputs

# Before the gap between the first two houses, and 200 m on before the third.
POSES = (Pose(12.0, -6.0, 2.5, 0.0), Pose(206.0, -6.0, 2.5, 0.0))
GABLED = Roof("gabled", 3.0)


@cache
def planned(*poses: Pose) -> Plan:
    """Three houses with gables on a street, the third far from the others, and a shed."""
    houses = [
        Building(name, shapely.box(x, 0, x + 8, 10), 6.0, "height", roof=GABLED)
        for name, x in (("a", 0.0), ("b", 16.0), ("c", 202.0))
    ]
    shed = Building("shed", shapely.box(9.5, 3, 14.5, 6), 2.3, "height")
    plan = build_plan(
        BlockInputs([*houses, shed], [Street("1", None, shapely.LineString([(-10, -6), (230, -6)]))], floor_height=3.2),
        IngestSettings(
            texels_per_metre=4.0,
            viewpoint_spacing=20.0,
            viewpoint_height=2.5,
            visibility_range=25.0,
            panorama_width=128,
            walls="exemplar",
        ),
    )
    return replace_panoramas(plan, poses, [(512, 1024)] * len(poses))


def test_charts_are_walls_and_roofs_that_are_no_facades_before_a_camera() -> None:
    plan = planned(*POSES)
    assert [one.name for one in WALLS.outline(NO_BLOCK, plan)] == ["a", "b", "c", "shed"]
    charts = plan.scene.charts
    for building, own in plan.walls_near_cameras().items():
        assert set(charts.kind[own]) <= {ChartKind.WALL, ChartKind.ROOF}
        assert set(charts.building[own]) == {building}
        assert not set(own) & set(plan.facades.chart.tolist())
        assert min(charts.size[own].min(axis=1)) >= 0.6
    shed = plan.walls_near_cameras()[3]
    assert ChartKind.WALL in charts.kind[shed]
    assert charts.normals()[shed][:, 1].min() < -0.9  # its front; not its back, which the camera is behind
    assert charts.normals()[shed][:, 1].max() < 0.9
    assert [one.name for one in WALLS.outline(NO_BLOCK, planned(POSES[1]))] == ["c"]
    assert planned().walls_near_cameras() == {}
    assert list_wall_units(Value(), Value(panoramas=()), planned(), zarr.create_group({})) == []  # type: ignore[arg-type]


@dataclass(frozen=True)
class Posed:
    """Panoramas of a plan, as files in a folder, and which of them could not be posed."""

    plan: Plan
    folder: Path

    def path(self, number: int) -> Path:
        return self.folder / f"{number:02}.jpg"

    def units(self, *, failed: int | None = None) -> dict[str, Unit[WallInputs]]:
        """What is due of walls and roofs, by building."""
        run: Any = Value(texture=TextureSettings(texels_per_metre=4.0))
        poses = self.plan.poses
        group = zarr.create_group({})
        group.create_array("journal/poses", shape=(len(poses),), chunks=(1,), dtype=str)
        for number, pose in enumerate(poses):
            known = {"unit": str(number), "key": "k", "status": "failed" if number == failed else "done", "squares": []}
            place = [pose.x, pose.y, pose.z, pose.heading, 0.0, 0.0]
            write_record(group, "poses", number, known | {"pose": place})  # type: ignore[arg-type]
        block: Any = Value(panoramas=[Value(path=self.path(number)) for number in range(len(poses))])
        return {unit.name: unit for unit in WALLS.list_units(run, block, self.plan, group)}


NO_BLOCK: Any = None
RUN: Any = Value(texture=TextureSettings(texels_per_metre=4.0, panorama_width=128))


def _last(plan: Plan) -> Any:
    return {"panoramas/rgb": Value(shape=(len(plan.viewpoints), 64, 128, 3))}


def written(plan: Plan, folder: Path) -> Posed:
    posed = Posed(plan, folder)
    for number in range(len(plan.poses)):
        posed.path(number).write_bytes(b"")
    return posed


def due(units: dict[str, Unit[WallInputs]], first: dict[str, Unit[WallInputs]]) -> dict[str, list[str]]:
    return {name: differing_inputs(unit.key, first[name].key) for name, unit in units.items()}


def test_a_changed_picture_makes_due_what_it_is_near_and_a_failed_pose_takes_part_in_none(tmp_path: Path) -> None:
    posed = written(planned(*POSES), tmp_path)
    first = posed.units()
    assert {name: {one.path.name for of in unit.inputs.panoramas for one in of} for name, unit in first.items()} == {
        "a": {"00.jpg"},
        "b": {"00.jpg"},
        "c": {"01.jpg"},
        "shed": {"00.jpg"},
    }
    posed.path(1).write_bytes(b"another")
    assert due(posed.units(), first) == {"a": [], "b": [], "c": ["panoramas"], "shed": []}
    assert not any(posed.units(failed=1)["c"].inputs.panoramas)


@cache
def long_planned() -> Plan:
    """A hall of 120 m on a street with a panorama each 6 m; the last stands before its end, beyond it."""
    hall = Building("hall", shapely.box(0, 0, 120, 12), 8.0, "height", roof=Roof("gabled", 12.0))
    plan = build_plan(
        BlockInputs([hall], [Street("1", None, shapely.LineString([(-10, -8), (150, -8)]))], floor_height=3.2),
        IngestSettings(
            texels_per_metre=4.0,
            viewpoint_spacing=40.0,
            viewpoint_height=2.5,
            visibility_range=25.0,
            panorama_width=128,
            walls="exemplar",
        ),
    )
    poses = [Pose(float(x), -8.0, 2.5, 0.0) for x in range(0, 121, 6)]
    return replace_panoramas(plan, [*poses, Pose(135.0, -2.0, 2.5, 0.0)], [(512, 1024)] * (len(poses) + 1))


def test_the_ends_of_a_long_building_are_taken_from_who_stands_before_them(tmp_path: Path) -> None:
    plan = long_planned()
    posed, charts, last = written(plan, tmp_path), plan.scene.charts, len(plan.poses) - 1
    first = posed.units()
    own, taken = first["hall"].charts, first["hall"].inputs.panoramas
    of_chart = {chart: {int(one.path.stem) for one in of} for chart, of in zip(own, taken, strict=True)}
    assert max(map(len, of_chart.values())) <= MAX_PANORAMAS_PER_SURFACE
    (gable,) = (chart for chart in own if charts.normals()[chart, 0] > 0.9)
    assert of_chart[gable] == {last}, "the others stand behind it"
    roofs = [chart for chart in own if charts.kind[chart] == ChartKind.ROOF and charts.normals()[chart, 1] < -0.1]
    shown = sorted(plan.poses[one].x for one in set().union(*(of_chart[roof] for roof in roofs)))
    assert shown[0] < 20, "from one end"
    assert shown[-1] > 100, "to the other"
    assert max(np.diff(shown)) < MAX_PIECE_M
    posed.path(last).write_bytes(b"another")
    assert due(posed.units(), first) == {"hall": ["panoramas"]}
    again = posed.units()
    unused = set(range(last)) - set().union(*of_chart.values())
    for one in unused:
        posed.path(one).write_bytes(b"another")
    assert unused
    assert due(posed.units(), again) == {"hall": []}, "of those that it is not taken from"


def test_units_stay_where_their_charts_do_and_what_no_camera_shows_any_more_is_cleared() -> None:
    before, after = planned(*POSES), planned(POSES[1])
    nothing: dict[str, Any] = {stage: [] for stage in STAGE_NAMES}
    block: Any = Value(panoramas=(), exemplars=())

    def match_walls(one: Plan, other: Plan) -> tuple[dict[int, int], dict[int, int]]:
        matches, stays = match_units(block, one, other, nothing)
        return matches["walls"], stays

    again, stays = match_walls(before, after)
    assert again == {0: 2}
    gone = {chart for building, own in before.walls_near_cameras().items() if building != 2 for chart in own}
    assert not gone & stays.keys()
    placement = before.scene.placement
    moved = replace(placement, x=np.where(np.arange(len(placement.x)) == min(gone), placement.x + 64, placement.x))
    other = replace(before, scene=replace(before.scene, placement=moved))
    owner = int(before.scene.charts.building[min(gone)])
    again, stays = match_walls(before, other)
    assert again == {unit: unit for unit in range(4) if unit != owner}
    assert np.isin(before.walls_near_cameras()[owner], list(stays)).sum() == 0
