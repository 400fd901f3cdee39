"""What training the translator refuses before it renders anything."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from facade_core.errors import InputError, ModelError
from facade_core.street import translator_training
from facade_core.street.translator_training import SMALL
from tasks.training.translator import Places, panoramas, train_translator


def test_without_torch_it_ends_before_anything_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(translator_training, "find_spec", lambda name: None)
    places = Places(("nowhere",))
    with pytest.raises(ModelError, match="make train-setup"):
        train_translator(
            [tmp_path / "none"], [tmp_path / "none.yaml"], tmp_path / "out", seed=0, course=SMALL, places=places
        )
    assert not any(tmp_path.iterdir())


def test_panoramas_are_split_by_place_and_pictures_of_other_shapes_are_not_taken(tmp_path: Path) -> None:
    for name, size in {"here_1": (64, 32), "there_1": (64, 32), "out_1": (64, 32), "photo": (64, 48)}.items():
        Image.new("RGB", size, (90, 120, 150)).save(tmp_path / f"{name}.png")
    learnt, judged, names = panoramas([tmp_path], Places(("there",), ("out",)))
    assert (len(learnt), len(judged), names) == (1, 1, [f"{tmp_path.name}/here_1.png"])
    with pytest.raises(InputError, match=r"2 panoramas .* to learn from and 0 to judge by"):
        panoramas([tmp_path], Places(("nowhere",), ("out",)))
