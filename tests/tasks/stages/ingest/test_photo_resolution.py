"""Photos of facades raise them to the pixels that they have on the wall, by their headers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from catalogs.block.reader import read_block
from facade_core.atlas.store import BRANCH, open_repository
from facade_core.plan.plan import Plan
from facade_core.plan.plan_tables import read_plan
from tasks.city.block_counts import block_counts_from_plan
from tasks.engine.run_key import create_run
from tasks.stages.ingest.task import ingest_block
from tests.pipeline.stages import STREETS, write_block

TEXELS = 8
# South-western corner, width, depth and height: the wall of the painted facade.
HOUSES = {"a": (4, 5, 16, 2.8, 14.0), "c": (4, 605, 16, 2.8, 14.0)}


def write_houses(folder: Path, *, rectified: bool) -> Path:
    return write_block(
        folder,
        buildings=HOUSES,
        streets={name: STREETS[name] for name in ("1", "3")},
        imagery={"photos": {"path": "photos", "rectified": rectified}, "exemplars": {"path": "exemplars"}},
        texture={"texels_per_metre": TEXELS},
    )


def ingest_and_read_plan(block_file: Path, out: Path) -> Plan:
    out.mkdir(exist_ok=True)
    block = read_block(block_file)
    ingest_block.fn(create_run(block, out), block)
    return read_plan(open_repository(out / "store").readonly_session(BRANCH))


def densities(plan: Plan) -> dict[str, float]:
    return dict(zip(plan.facades.id, plan.scene.placement.texels_per_metre[plan.facades.chart].tolist(), strict=True))


def test_a_rectified_photo_is_its_wall_by_its_header(tmp_path: Path) -> None:
    folder = tmp_path / "in"
    (folder / "photos").mkdir(parents=True)
    for facade, per_metre in (("a-0", 12.2), ("c-0", 7.0)):
        Image.new("RGB", (round(16 * per_metre), round(14 * per_metre))).save(folder / "photos" / f"{facade}.png")
    block_file = write_houses(folder, rectified=True)
    plan = ingest_and_read_plan(block_file, tmp_path / "out")
    found = densities(plan)
    assert found["a-0"] == 12
    assert block_counts_from_plan(read_block(block_file))["megatexels"] == plan.texel_counts().sum() / 1e6
    assert {density for name, density in found.items() if name != "a-0"} <= {TEXELS, TEXELS / 2}


def test_half_of_a_photo_as_taken_is_its_wall(tmp_path: Path) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    (folder / "photos").mkdir(parents=True)
    for facade, per_metre in (("a-0", 12.2), ("c-0", 7.0)):
        size = (round(16 * per_metre * 2**0.5), round(14 * per_metre * 2**0.5))
        Image.new("RGB", size).save(folder / "photos" / f"{facade}.png")
    block_file = write_houses(folder, rectified=False)
    first = ingest_and_read_plan(block_file, out)
    assert densities(first)["a-0"] == 12
    assert densities(first)["c-0"] == TEXELS

    (folder / "photos" / "a-0.png").write_bytes(b"no picture")
    again = ingest_and_read_plan(block_file, out)
    assert densities(again) == densities(first) | {"a-0": TEXELS}
    changed = np.flatnonzero(again.ids != first.ids)
    assert changed.tolist() == [first.facades.chart[first.facades.id.index("a-0")]]
    assert (ingest_and_read_plan(block_file, tmp_path / "fresh").ids == again.ids).all()
