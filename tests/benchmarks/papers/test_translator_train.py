"""Pictures and renderings that the translator learns from."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from benchmarks.papers.translator.network_training import RECIPE
from benchmarks.papers.translator.street_renderings import render_procedural_street, render_run_sequences
from benchmarks.papers.translator.train import (
    PictureSplitPrefixes,
    list_pictures,
    read_picture_sets,
    train_translator,
)
from facade_core.core.errors import InputError, ModelFileError
from training import torch_files


def test_without_torch_it_ends_before_anything_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch_files, "find_spec", lambda name: None)
    places = PictureSplitPrefixes(("nowhere",))
    with pytest.raises(ModelFileError, match="make train-setup"):
        train_translator(
            [tmp_path / "none"], [tmp_path / "none"], tmp_path / "out", seed=0, recipe=RECIPE, split=places
        )
    assert not any(tmp_path.iterdir())


def test_pictures_are_split_by_place(tmp_path: Path) -> None:
    for name, size in {"here_1": (64, 32), "there_1": (64, 32), "out_1": (64, 32), "photo": (64, 48)}.items():
        Image.new("RGB", size, (90, 120, 150)).save(tmp_path / f"{name}.png")
    learnt, judged, names = read_picture_sets(list_pictures([tmp_path]), PictureSplitPrefixes(("there",), ("out",)))
    assert (len(learnt), len(judged), names) == (2, 1, [f"{tmp_path.name}/here_1.png", f"{tmp_path.name}/photo.png"])
    with pytest.raises(InputError, match=r"3 pictures to learn from and 0 to judge by"):
        read_picture_sets(list_pictures([tmp_path]), PictureSplitPrefixes(("nowhere",), ("out",)))
    learnt, judged, names = read_picture_sets(list_pictures([tmp_path]), PictureSplitPrefixes())
    assert (len(learnt), len(judged)) == (3, 1), "the last fifth judges"


def test_a_folder_without_a_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no run of a block"):
        next(render_run_sequences(tmp_path, 1, seed=0))


def test_procedural_streets_know_what_earlier_viewpoints_showed() -> None:
    views = render_procedural_street(seed=1, bare=False)
    first, second = views[:2]
    assert not first.earlier.any()
    assert second.earlier.any()
    assert not (second.earlier & second.given).any()
    assert first.given[: len(first.given) // 8].all(), "the sky is given"
    assert not first.given[-1].any(), "the ground is painted"
    bare = render_procedural_street(seed=1, bare=True)
    assert bare[0].given.sum() < first.given.sum(), "walls are painted too"
