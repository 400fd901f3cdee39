"""The facades that inpainting is judged on."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.inpainting.cases import cases
from training.datasets.facades import CMP, ECP, read_dataset, split_facades_for_training


@pytest.mark.long
def test_no_facade_that_is_judged_has_trained_the_parser(data: Path) -> None:
    held_out = {
        f"{recipe.name}_{facade.name}"
        for recipe in (ECP, CMP)
        for facade in split_facades_for_training(list(read_dataset(recipe, data / "facades" / recipe.name)))[1]
    }
    judged = [case.name for case in cases(data, 6)]
    assert len(set(judged)) == 6
    assert set(judged) <= held_out
