"""Perspective pictures before one house, and one from the air: facade, ground and roof are theirs, as of panoramas."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
import zarr

from facade_core.atlas.journal import read_journal
from facade_core.atlas.rasters import TexelLayout, read_rasters
from facade_core.atlas.store import open_repository
from facade_core.core.provenance import Provenance
from facade_core.geometry.charts import ChartKind
from facade_core.plan.plan_tables import read_plan
from tests.pipeline.perspective_pictures import CAMERAS, LENS, NEEDLESS, WALL, write_picture_block
from tests.pipeline.stages import texture


@pytest.mark.long
def test_facade_ground_and_roof_are_taken_from_perspective_pictures(tmp_path: Path) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    block_file = write_picture_block(folder)
    texture(block_file, out, stop_before="streets")
    session = open_repository(out / "store").readonly_session("main")
    group, plan = zarr.open_group(session.store, mode="r"), read_plan(session)
    assert all(pose.lens == LENS for pose in plan.poses)
    records = {record["unit"]: record for record in read_journal(group, "poses") if record}
    assert set(records) == {f"{name}.jpg" for name in CAMERAS | NEEDLESS}
    poses = {name: record for name, record in records.items() if not record.get("is_unused")}
    assert set(poses) == {f"{name}.jpg" for name in CAMERAS}
    assert "1 of 5 pictures show nothing that others do not show better: not used" in group.attrs["notes"]
    # the stated poses are right, and stay
    assert all(record["moved_m"] < 0.1 and record["turned_deg"] < 0.3 for record in poses.values())
    (facade,) = [record for record in read_journal(group, "facades") if record and "street-" in record["source"]]
    assert {"street-1.jpg", "street-2.jpg"} <= set(facade["source"].split(", "))
    chart = int(plan.facades.chart[plan.facades.id.index(facade["unit"])])
    wall = _texels(group, plan, chart)
    painted = cv2.resize(WALL, wall.shape[1::-1], interpolation=cv2.INTER_AREA)
    assert 10 * np.log10(255**2 / np.mean((wall.astype(float) - painted) ** 2)) > 20
    cameras = {
        stage: {name for record in read_journal(group, stage) if record for name, *_ in record["cameras"]}
        for stage in ("walls", "grounds")
    }
    assert cameras["walls"] & {"air-1.jpg", "air-2.jpg"}
    assert cameras["grounds"]
    roof = int(np.flatnonzero(plan.scene.charts.kind == ChartKind.ROOF)[0])
    evidence = _texels(group, plan, roof, "atlas/seed_evidence")
    assert (evidence == Provenance.PHOTO).mean() > 0.3


def _texels(group: zarr.Group, plan, chart: int, name: str = "atlas/seed") -> np.ndarray:
    layout = TexelLayout.of_charts(plan.scene.placement, [chart])
    height, width = plan.scene.placement.shape(chart)
    flat = read_rasters(group[name], plan.scene.placement, layout)
    return flat[layout.texel_slice(plan.scene.placement, chart)].reshape(height, width, *flat.shape[1:])
