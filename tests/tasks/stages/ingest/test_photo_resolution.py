"""Photos of facades raise them to the pixels that they have on the wall; one as taken is opened for it once."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from catalogs.block.reader import read_block
from facade_core.atlas.store import BRANCH, open_repository
from facade_core.plan.plan import Plan
from facade_core.plan.plan_tables import read_plan
from facade_core.synth.facade import paint_facade
from tasks.city.block_counts import block_counts_from_plan
from tasks.engine.run_key import create_run
from tasks.stages.ingest import photo_crops
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


def write_photo_as_taken(path: Path, seed: int) -> None:
    """Write the facade of a house as seen by a camera to the left of its middle that looks up."""
    image = paint_facade((16.0, 14.0), floors=4, columns=5, style="haussmann", metres_per_pixel=0.03, seed=seed).image
    height, width = image.shape[:2]
    corners = np.float32([[0, 0], [width, 0], [width, height], [0, height]])
    turned = cv2.getPerspectiveTransform(corners, np.float32([[190, 90], [900, 210], [880, 880], [110, 960]]))
    sky = np.full((1050, 1000, 3), (170, 190, 215), np.uint8)
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(cv2.warpPerspective(image, turned, (1000, 1050), sky, borderMode=cv2.BORDER_TRANSPARENT)).save(path)


def ingested(block_file: Path, out: Path) -> Plan:
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
    plan = ingested(block_file, tmp_path / "out")
    found = densities(plan)
    assert found["a-0"] == 12
    assert block_counts_from_plan(read_block(block_file))["megatexels"] == plan.texel_counts().sum() / 1e6
    assert {density for name, density in found.items() if name != "a-0"} <= {TEXELS, TEXELS / 2}


def test_a_photo_as_taken_is_opened_once_and_counts_by_its_facade(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = []
    crop = photo_crops.crop_photo_to_wall

    def record_and_crop(path: Path, *more: object) -> object:
        opened.append(path.stem)
        return crop(path, *more)

    monkeypatch.setattr(photo_crops, "crop_photo_to_wall", record_and_crop)
    folder, out = tmp_path / "in", tmp_path / "out"
    for seed, facade in enumerate(("a-0", "c-0"), 4):
        write_photo_as_taken(folder / "photos" / f"{facade}.png", seed)
    block_file = write_houses(folder, rectified=False)
    first = ingested(block_file, out)
    assert opened == ["a-0", "c-0"]
    assert densities(first)["a-0"] == densities(first)["c-0"] == 14, "as its building affords"

    Image.fromarray(np.full((300, 400, 3), 128, np.uint8)).save(folder / "photos" / "a-0.png")
    again = ingested(block_file, out)
    assert opened == ["a-0", "c-0", "a-0"]
    assert densities(again) == densities(first) | {"a-0": TEXELS}
    changed = np.flatnonzero(again.ids != first.ids)
    assert changed.tolist() == [first.facades.chart[first.facades.id.index("a-0")]]
    assert (ingested(block_file, tmp_path / "fresh").ids == again.ids).all()
    write_houses(folder, rectified=False)
    ingested(block_file, out)
    assert len(opened) == 5, "the photos of the fresh store alone"
