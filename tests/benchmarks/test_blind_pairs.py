"""Answers of blind pairs, and the sheets that show the pairs."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.blind_answers import count_answers, write_key
from benchmarks.blind_pairs import sheet

KEY = {"pairs": {"1": {"A": "out", "B": "against"}, "2": {"A": "against", "B": "out"}}}


def test_answers_are_counted_by_the_key() -> None:
    answers = [
        {"pair": "1", "preferred": "a", "why": "kerbs; light"},
        {"pair": "2", "preferred": "B", "why": "light"},
    ]
    assert count_answers(answers, KEY)["preferred"] == {"out": 2, "against": 0, "neither": 0}
    assert count_answers(answers, KEY)["why"] == {"out": {"light": 2, "kerbs": 1}}
    assert count_answers([{"pair": "2", "preferred": "", "why": ""}], KEY)["preferred"]["neither"] == 1


@pytest.mark.parametrize("answer", [{"pair": "3", "preferred": "A"}, {"pair": "1", "preferred": "left"}])
def test_an_answer_that_fits_no_pair_is_refused(answer: dict[str, str]) -> None:
    with pytest.raises(SystemExit, match="say A, B or nothing"):
        count_answers([{"why": "", **answer}], KEY)


def test_answers_count_by_the_key_that_is_written_with_them(tmp_path: Path) -> None:
    write_key(tmp_path, [("out", "against"), ("against", "out")], seed=3)
    key = json.loads((tmp_path / "key.json").read_text(encoding="utf-8"))
    assert key == {"seed": 3, **KEY}
    with (tmp_path / "answers.csv").open(encoding="utf-8", newline="") as file:
        answers = [row | {"preferred": "A"} for row in csv.DictReader(file)]
    assert count_answers(answers, key)["preferred"] == {"out": 1, "against": 1, "neither": 0}


def test_a_sheet_holds_all_its_pairs() -> None:
    dark, bright = np.zeros((20, 30, 3), np.uint8), np.full((20, 30, 3), 200, np.uint8)
    drawn = sheet([(dark, bright)] * 3, 1)
    assert (drawn == 200).all(axis=2).sum() == 3 * 20 * 30
