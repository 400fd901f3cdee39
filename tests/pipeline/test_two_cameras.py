"""Cameras before houses: two are refined together and agree on the ground, and one more changes what it shows alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import zarr

from facade_core.atlas.journal import read_journal
from facade_core.atlas.rasters import TexelLayout, read_rasters
from facade_core.atlas.store import open_repository
from facade_core.core.provenance import Provenance
from facade_core.plan.plan_tables import read_plan
from tasks.stages.bundles.refined_poses import read_bundled_pose_records
from tests.pipeline.painted_panoramas import FAR, HEIGHT_M, PAVED, write_panorama_block, write_panoramas
from tests.pipeline.stages import (
    BUILDINGS,
    EAST,
    NORTH,
    STREETS,
    charts_of,
    digests_of,
    redone,
    started,
    texture,
    write_block,
)

pytestmark = pytest.mark.long

SEEDED = ("seed", "seed_evidence")


def test_two_cameras_agree_on_the_ground_and_one_more_changes_what_it_shows(tmp_path: Path) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    cameras = {"a-1": (8.0, -1.0, 2.5), "a-2": (12.5, 0.5, 3.0), "c-1": (9.0, FAR - 1, 2.5)}
    write_panoramas(folder, cameras)
    block_file = write_panorama_block(folder)
    texture(block_file, out, stop_before="streets")
    session = open_repository(out / "store").readonly_session("main")
    group, plan = zarr.open_group(session.store, mode="r"), read_plan(session)
    poses = {record["unit"]: record for record in read_bundled_pose_records(group) if record}
    assert [record["unit"] for record in read_journal(group, "bundles") if record] == ["a-1.jpg"]
    for name in ("a-1.jpg", "a-2.jpg"):
        told = poses[name]
        assert told["kept_alone"] == ""
        assert told["shared"] == 2
        assert told["apart_before_m"] > 0.2 > 0.05 > told["apart_m"]
        assert told["pose"][2] == pytest.approx(HEIGHT_M, abs=0.1), "the ground tells whose height is wrong"
        assert told["over_ground_m"] == told["pose"][2]
    assert "shared" not in poses["c-1.jpg"], "it is alone there"

    taken = [record for record in read_journal(group, "grounds") if record and len(record["cameras"]) > 1]
    (ground,) = taken
    assert {name for name, *_ in ground["cameras"]} == {"a-1.jpg", "a-2.jpg"}
    chart = int(np.flatnonzero(plan.ids == int(ground["unit"].removeprefix("ground-"), 16))[0])
    one = TexelLayout.of_charts(plan.scene.placement, [chart])
    seed, evidence = (read_rasters(group[f"atlas/{name}"], plan.scene.placement, one) for name in SEEDED)
    shown = evidence == Provenance.PHOTO
    assert shown.mean() > 0.2
    size = plan.scene.placement.shape(chart)
    rows, columns = (at.ravel() for at in np.indices(size))
    points = plan.scene.charts.points(chart, (columns + 0.5) / 4, (rows + 0.5) / 4)
    column, row = ((points[:, axis] - origin + 10) * 4 for axis, origin in ((0, EAST), (1, NORTH)))
    shown &= (column >= 4) & (column < 164) & (row >= 4) & (row < 84)
    truth = PAVED[row[shown].astype(int), column[shown].astype(int)]
    assert np.corrcoef(seed[shown, 0].astype(float), truth.astype(float))[0, 1] > 0.8

    before = started(out)
    write_panoramas(folder, cameras | {"a-3": (10.0, 0.0, 2.5)})
    texture(block_file, out, stop_before="streets")
    again = redone(before, out)
    assert {unit for stage, unit in again if stage == "poses"} == {"a-3.jpg"}
    assert {unit for stage, unit in again if stage == "bundles"} == {"a-1.jpg"}
    assert {unit.partition("-")[0] for stage, unit in again if stage == "facades"} == {"a"}


def test_a_sharp_camera_makes_its_own_house_finer_and_does_nothing_else_again(tmp_path: Path) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    write_panoramas(folder, {"c-1": (9.0, FAR - 1, 2.5)})
    block_file = write_block(
        folder,
        buildings={name: BUILDINGS[name] for name in ("a", "c")},
        streets={name: STREETS[name] for name in ("1", "3")},
        imagery={"panoramas": {"path": "panoramas", "poses": "poses.json"}, "exemplars": {"path": "exemplars"}},
        texture={"texels_per_metre": 8},
    )
    texture(block_file, out)
    density, first = densities(out), digests_of(out)
    assert max(density["c"]) == 16
    assert max(density["a"]) == 8

    before = started(out)
    write_panoramas(folder, {"c-1": (9.0, FAR - 1, 2.5), "a-1": (8.0, -1.0, 2.5)})
    made = texture(block_file, out)
    assert max(densities(out)["a"]) == 16
    assert densities(out)["c"] == density["c"]
    again = redone(before, out)
    assert {unit.partition("-")[0] for stage, unit in again if stage == "facades"} == {"a"}
    assert {unit.partition("-")[0] for stage, unit in again if stage == "surfaces"} <= {"a", "ground"}
    fresh = texture(block_file, tmp_path / "fresh")
    one, other = charts_of(made.run), charts_of(fresh.run)
    assert one.keys() == other.keys()
    for chart, arrays in other.items():
        for mine, theirs in zip(one[chart], arrays, strict=True):
            np.testing.assert_array_equal(mine, theirs)
    assert digests_of(out) == digests_of(tmp_path / "fresh")

    (folder / "panoramas" / "a-1.jpg").unlink()
    write_panoramas(folder, {"c-1": (9.0, FAR - 1, 2.5)})
    texture(block_file, out)
    assert densities(out) == density
    assert digests_of(out) == first


def densities(out: Path) -> dict[str, list[float]]:
    """Texels per metre of the facades of each building."""
    plan = read_plan(open_repository(out / "store").readonly_session("main"))
    found: dict[str, list[float]] = {}
    for chart, building in zip(plan.facades.chart.tolist(), plan.facades.building.tolist(), strict=True):
        found.setdefault(plan.scene.names[building], []).append(float(plan.scene.placement.texels_per_metre[chart]))
    return found
