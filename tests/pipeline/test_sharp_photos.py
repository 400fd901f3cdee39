"""Sharp photos of facades: each makes its own facade finer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.painter.facade import paint_facade
from facade_core.atlas.rasters import TexelLayout, read_rasters
from facade_core.atlas.store import open_repository, open_root
from facade_core.core.resizing import resize_image
from facade_core.plan.plan_tables import read_plan
from tests.pipeline.stages import BUILDINGS, STREETS, charts_of, digests_of, redone, started, texture, write_block

TEXELS = 8


def write_photo_of_wall(folder: Path, facade: str, per_metre: float) -> None:
    """Write a photo of a wall of 12 x 7 m at a number of pixels per metre."""
    painted = paint_facade(
        (12.0, 7.0), floors=2, columns=4, style="haussmann", metres_per_pixel=1 / per_metre, seed=len(facade)
    )
    (folder / "photos").mkdir(parents=True, exist_ok=True)
    Image.fromarray(painted.image).save(folder / "photos" / f"{facade}.png")


def densities(out: Path) -> dict[str, float]:
    """Texels per metre of each facade."""
    plan = read_plan(open_repository(out / "store").readonly_session("main"))
    return dict(zip(plan.facades.id, plan.scene.placement.texels_per_metre[plan.facades.chart].tolist(), strict=True))


def image_of_facade(out: Path, facade: str) -> np.ndarray:
    """Colour of a facade, (h, w, 3) uint8."""
    session = open_repository(out / "store").readonly_session("main")
    plan, group = read_plan(session), open_root(session)
    placement, chart = plan.scene.placement, int(plan.facades.chart[plan.facades.id.index(facade)])
    flat = read_rasters(group["atlas/colour"], placement, TexelLayout.of_charts(placement, [chart]))
    return flat.reshape(placement.height[chart], placement.width[chart], 3)


@pytest.mark.long
def test_a_sharp_photo_makes_its_facade_finer_and_does_nothing_else_again(tmp_path: Path) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    write_photo_of_wall(folder, "a-0", 8)
    write_photo_of_wall(folder, "c-0", 12)
    block_file = write_block(
        folder,
        buildings={name: BUILDINGS[name] for name in ("a", "c")},
        streets={name: STREETS[name] for name in ("1", "3")},
        texture={"texels_per_metre": TEXELS},
    )
    texture(block_file, out)
    first, atlas = densities(out), digests_of(out)
    assert first["a-0"] == TEXELS
    assert first["c-0"] == 12
    before = started(out)
    texture(block_file, out)
    assert not redone(before, out)

    write_photo_of_wall(folder, "a-0", 16)
    coarse = image_of_facade(out, "a-0")
    textured = texture(block_file, out)
    assert densities(out) == first | {"a-0": 16}
    fine = image_of_facade(out, "a-0")
    photo = np.asarray(Image.open(folder / "photos" / "a-0.png"))
    enlarged = resize_image(coarse, fine.shape[:2])
    errors = [np.abs(image.astype(float) - resize_image(photo, fine.shape[:2])).mean() for image in (enlarged, fine)]
    assert errors[1] < 0.8 * errors[0]
    again = redone(before, out)
    assert {unit for stage, unit in again if stage == "facades"} == {
        unit for stage, unit in before if stage == "facades" and unit.startswith("a-")
    }
    assert {unit.partition("-")[0] for stage, unit in again if stage == "surfaces"} <= {"a", "ground"}
    fresh = texture(block_file, tmp_path / "fresh")
    one, other = charts_of(textured.run), charts_of(fresh.run)
    assert one.keys() == other.keys()
    for chart, arrays in other.items():
        for mine, theirs in zip(one[chart], arrays, strict=True):
            np.testing.assert_array_equal(mine, theirs)
    assert digests_of(out) == digests_of(tmp_path / "fresh")

    write_photo_of_wall(folder, "a-0", 8)
    texture(block_file, out)
    assert densities(out) == first
    assert digests_of(out) == atlas
