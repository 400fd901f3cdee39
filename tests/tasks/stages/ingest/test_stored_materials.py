"""The store keeps the materials of a block's own pictures: these may be moved or renamed later."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from catalogs.block import read_block
from facade_core.atlas.store import BRANCH, open_repository, open_root
from facade_core.plan.plan_tables import read_plan
from tasks.engine.run_key import create_run
from tasks.stages.ingest.task import ingest_block
from tasks.stages.shared.materials import material_field, rebuild_material_field
from tests.pipeline.stages import write_block

ROOF = {"roof_material": {"path": "roof.png", "metres_per_pixel": 0.02}}


@pytest.mark.parametrize("own", [{}, ROOF, {"materials": "own"}, ROOF | {"materials": "own"}])
def test_a_store_has_the_materials_of_pictures_that_are_gone(tmp_path: Path, own: dict[str, Any]) -> None:
    folder, noise = tmp_path / "in", np.random.default_rng(0).integers(0, 255, (64, 64, 3), np.uint8)
    (folder / "own").mkdir(parents=True)
    Image.fromarray(noise).save(folder / "roof.png")
    Image.fromarray(noise[::-1]).save(folder / "own" / "slabs.png")
    Image.fromarray(noise[:, ::-1]).save(folder / "own" / "roof-tiles-0.8m.png")
    block = read_block(write_block(folder, texture={"walls": "translate"} | own))
    run = create_run(block, tmp_path / "out")
    run.local.mkdir()
    ingest_block.fn(run, block)
    session = open_repository(run.store).readonly_session(BRANCH)
    group, plan = open_root(session), read_plan(session)
    expected = material_field(plan, run.seed, run.roof_material, run.materials).arrays
    shutil.rmtree(folder)
    found = rebuild_material_field(group, plan)
    assert (found.arrays.charts.material == expected.charts.material).all()
    for one, other in ((found.arrays.grains, expected.grains), (found.arrays.roof, expected.roof)):
        for name, array, wanted in zip(one._fields, one, other, strict=True):
            np.testing.assert_array_equal(array, wanted, err_msg=name)
