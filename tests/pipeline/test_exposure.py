"""A house photographed from two sides, one of them dark: its walls have one exposure, also after one photo changes."""

from __future__ import annotations

from pathlib import Path
from typing import cast

import numpy as np
import pytest
from PIL import Image

from benchmarks.painter.facade import paint_facade
from facade_core.atlas.journal import read_journal
from facade_core.atlas.rasters import read_chart_raster
from facade_core.atlas.store import open_repository, open_root
from facade_core.atlas.stored_files import read_stored_file
from facade_core.core.labels import FacadeClass
from facade_core.facade.variation.hierarchy import Hierarchy
from facade_core.facade.wall_material import lit_colour
from facade_core.plan.plan_tables import read_plan
from tasks.stages.facades.record import FacadeRecord
from tests.pipeline.stages import BUILDINGS, STREETS, redone, started, texture, write_block

pytestmark = pytest.mark.long

WALL = paint_facade((12.0, 7.0), floors=2, columns=4, style="jugend", metres_per_pixel=0.06, seed=2).image


def write_wall(folder: Path, facade: str, light: float) -> None:
    (folder / "photos").mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.rint(WALL * light).astype(np.uint8)).save(folder / "photos" / f"{facade}.png")


def read_walls(out: Path) -> dict[str, tuple[FacadeRecord, np.ndarray, np.ndarray]]:
    """The record, colour of the wall and picture of each facade from a photo; the variations show that picture."""
    session = open_repository(out / "store").readonly_session("main")
    group, plan = open_root(session), read_plan(session)
    found = {}
    for facade, record in enumerate(read_journal(group, "facades", FacadeRecord)):
        if record and "pictured_colour" in record:
            chart = int(plan.facades.chart[facade])
            image, labels = (
                read_chart_raster(group, plan.scene.placement, chart, name)
                for name in ("atlas/seed", "facade_maps/labels")
            )
            if "variation_file" in record:
                file = read_stored_file(group, record["variation_file"], record["variation_digest"])
                drawn = Hierarchy.from_bytes(file).reconstruct(record["variation_levels"] - 1)
                assert np.abs(drawn.mean(axis=(0, 1)) - image.mean(axis=(0, 1))).max() < 5
            found[record["unit"]] = record, lit_colour(image[labels == FacadeClass.WALL]), image
    return found


def test_two_sides_of_a_house_have_one_exposure(tmp_path: Path) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    for facade, light in (("a-0", 1.0), ("a-2", 0.6)):
        write_wall(folder, facade, light)
    block = {"buildings": {"a": BUILDINGS["a"]}, "streets": {"1": STREETS["1"]}}
    texture(write_block(folder, **cast(dict, block)), out, stop_before="streets")
    walls = read_walls(out)
    assert set(walls) == {"a-0", "a-2"}
    (light, light_colour, _), (dark, dark_colour, _) = walls["a-0"], walls["a-2"]
    assert np.mean(dark["pictured_colour"]) < 0.7 * np.mean(light["pictured_colour"])
    assert "tone_slope" not in light
    assert min(dark["tone_slope"]) > 1.3
    assert np.abs(dark_colour - light_colour).max() < 0.1 * light_colour.mean()

    before = started(out)
    texture(folder / "block.yaml", out, stop_before="streets")
    assert not redone(before, out)
    write_wall(folder, "a-0", 0.6)
    texture(folder / "block.yaml", out, stop_before="streets")
    again = read_walls(out)
    assert {"a-0", "a-2"} <= {unit for stage, unit in redone(before, out) if stage == "facades"}
    assert "tone_slope" not in again["a-2"][0], "no wall of the house is lighter"
    np.testing.assert_allclose(again["a-2"][1], dark["pictured_colour"], atol=5)
