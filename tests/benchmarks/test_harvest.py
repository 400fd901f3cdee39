"""The verdicts on harvested exemplars: each is of a listed picture, is counted, and is drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.harvest import SETS, USABLE, count_verdicts, draw_sheet, read_judged_harvest


@pytest.mark.parametrize("name", SETS)
def test_every_verdict_is_on_a_listed_picture(name: str) -> None:
    pictures, verdicts = read_judged_harvest(name)
    names = [Path(picture).stem for picture in pictures]
    assert len(names) == len(set(names))
    assert set(verdicts) <= set(names)
    assert all(verdicts.values())


def test_no_picture_is_in_two_sets() -> None:
    first, second = (set(read_judged_harvest(name).pictures) for name in SETS)
    assert not first & second


def test_verdicts_are_counted_by_folder() -> None:
    counts = count_verdicts([("cmp", "a"), ("cmp", "b"), ("swiss", "c")], {"a": USABLE, "b": "trees over the wall"})
    assert counts["all"] == {"usable": 1, "flawed": 1, "unjudged": 1}
    assert counts["cmp"] == {"usable": 1, "flawed": 1, "unjudged": 0}
    assert counts["swiss"] == {"usable": 0, "flawed": 0, "unjudged": 1}


def test_the_sheet_shows_the_exemplars(tmp_path: Path) -> None:
    Image.new("RGB", (120, 90), (200, 40, 40)).save(tmp_path / "a.png")
    draw_sheet(tmp_path, ["a"], {"a": USABLE}, tmp_path / "sheet.png")
    sheet = np.asarray(Image.open(tmp_path / "sheet.png"))
    assert (sheet == (200, 40, 40)).all(axis=2).sum() == 120 * 90
    assert (sheet[95:] < 128).any(), "the verdict"
