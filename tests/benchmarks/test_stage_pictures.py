from pathlib import Path
from typing import cast

import numpy as np
import pytest

from benchmarks.stage_pictures import GAP, OF_NOTHING, PAPER, beside, of_run, rectified
from tasks.publish.published_run import PublishedBlock

STAGES = Path(__file__).parents[2] / "docs" / "stages"


def test_each_picture_is_there_and_its_page_names_the_command() -> None:
    drawn = {**of_run(cast(PublishedBlock, None), "", ""), **OF_NOTHING}
    assert {path.stem for path in STAGES.glob("*.jpg")} == set(drawn)
    for name in drawn:
        page = (STAGES / f"{name}.md").read_text("utf-8")
        assert f"({name}.jpg)" in page
        assert f"`python -m benchmarks.stage_pictures out/demo --only {name}`" in page
        assert 10_000 < (STAGES / f"{name}.jpg").stat().st_size < 250_000


def test_pictures_of_any_size_stand_beside_each_other_at_one_height() -> None:
    large, small = np.zeros((80, 40, 3), np.uint8), np.full((10, 30, 3), 7, np.uint8)
    drawn = beside([large, small], 20)
    assert drawn.shape == (20, 10 + GAP + 60, 3)
    assert (drawn[:, 10 : 10 + GAP] == PAPER).all()
    assert (drawn[:, 10 + GAP :] == 7).all()


def test_the_painted_facade_is_rectified_to_its_own_proportion() -> None:
    from benchmarks.painter.exemplars import paint_exemplar

    painted = paint_exemplar(0, seed=3).image
    drawn = rectified()
    gap = np.flatnonzero((drawn == PAPER).all(axis=(0, 2)))
    straight = drawn[:, gap[-1] + 1 :]
    share = straight.shape[1] / straight.shape[0]
    assert share == pytest.approx(painted.shape[1] / painted.shape[0], rel=0.2)
