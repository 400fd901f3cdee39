"""A facade off the streets that a panorama shows is taken from it."""

from __future__ import annotations

from pathlib import Path

import pytest

from facade_core.atlas.store import BRANCH, open_repository
from facade_core.geometry.walls import WallRole
from facade_core.plan.plan_tables import read_plan
from tasks.engine.store.commits import read_newest_journal
from tests.pipeline.stages import texture, write_block
from tests.pipeline.test_changes import WALL, captured

pytestmark = pytest.mark.long


def test_a_wall_on_a_yard_is_taken_from_who_stands_there(tmp_path: Path) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    captured(folder, {"yard": (0.0, WALL, 1.0, "2024-05-17"), "far": (-60.0, WALL, 0.8, "2024-05-17")})
    block_file = write_block(
        folder,
        buildings={"a": (4, 5, 12, 12, 7.0)},
        streets={"1": [(0, 30), (45, 30)]},
        imagery={"panoramas": {"path": "panoramas", "poses": "poses.json"}, "exemplars": {"path": "exemplars"}},
        texture={"texels_per_metre": 6},
    )
    texture(block_file, out)
    plan = read_plan(open_repository(out / "store").readonly_session(BRANCH))
    south = plan.scene.charts.normals()[plan.facades.chart][:, 1] < -0.9
    assert plan.facades.role[south].tolist() == [WallRole.BACK]
    shown = {r["unit"] for r in read_newest_journal(out / "store", "facades") if r and r["provenance"][-1] > 0}
    taken = {name for name, wall in zip(plan.facades.id, south.tolist(), strict=True) if wall}
    assert shown == taken, "and not from afar"
