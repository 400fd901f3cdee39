"""Facades that people corrected, as photos and layouts to learn from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.painter.exemplars import paint_exemplar_set
from facade_core.core.labels import CLASSES, ELEMENT_CLASSES, UNKNOWN, FacadeClass
from training.datasets import corrected_facades
from training.datasets.corrected_facades import CorrectedFacade, label_corrected_facade, layout_record
from training.datasets.facades import ANY_CLASS

(PAINTED,) = paint_exemplar_set(1, seed=3)
HEIGHT, WIDTH = PAINTED.labels.shape
# A window, by somebody, where the painter has whatever there is; and a balcony that lies over a part of it.
SAID = (("window", 0.25, 0.25, 0.5, 0.5), ("balcony", 0.25, 0.4, 0.5, 0.5))


def facade(shown: np.ndarray | None = None) -> CorrectedFacade:
    return CorrectedFacade("run/a-0", PAINTED.image, np.ones((HEIGHT, WIDTH), bool) if shown is None else shown, SAID)


def test_elements_are_what_was_said_and_nothing_else_is_one() -> None:
    told = label_corrected_facade(facade())
    assert told is not None
    window, balcony = (tuple(round(s * side) for s, side in zip(b[1:], (WIDTH, HEIGHT) * 2, strict=True)) for b in SAID)
    assert (told.labels[window[1] : balcony[1], window[0] : window[2]] == FacadeClass.WINDOW).all()
    assert (told.possible[balcony[1] : balcony[3], balcony[0] : balcony[2]] == 1 << CLASSES.index("balcony")).all()
    beyond = np.ones((HEIGHT, WIDTH), bool)
    beyond[window[1] : window[3], window[0] : window[2]] = False
    element = sum(1 << CLASSES.index(name) for name in ELEMENT_CLASSES)
    assert not (told.possible[beyond] & element).any(), "the painter's other windows were said to be none"
    assert (told.possible[beyond] & 1 << FacadeClass.WALL).mean() > 0.5
    assert (told.labels[told.possible == ANY_CLASS] == UNKNOWN).all()


def test_what_pictures_do_not_show_is_not_told_of() -> None:
    shown = np.ones((HEIGHT, WIDTH), bool)
    shown[HEIGHT // 3 :] = False
    told = label_corrected_facade(facade(shown))
    assert told is not None
    for layer, value in ((told.possible, ANY_CLASS), (told.labels, UNKNOWN), (told.occluder, UNKNOWN)):
        assert (layer[~shown] == value).all()
    assert label_corrected_facade(facade(np.zeros((HEIGHT, WIDTH), bool))) is None


def test_a_layout_is_what_was_said_whatever_is_shown() -> None:
    layout = layout_record(facade(np.zeros((HEIGHT, WIDTH), bool)))
    assert (layout.name, layout.domain) == ("run/a-0", (0, 0, WIDTH, HEIGHT))
    assert [(e.label, e.x0, e.y1) for e in layout.elements] == [
        ("window", 0.25 * WIDTH, 0.5 * HEIGHT), ("balcony", 0.25 * WIDTH, 0.5 * HEIGHT),
    ]  # fmt: skip


def test_the_parser_goes_on_from_the_shipped_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("torch", reason="torch is absent: make train-setup")
    from facade_core.core.errors import InputError
    from facade_core.core.model_file import read_model_record
    from facade_core.parsing.confidence import load_calibration
    from facade_core.parsing.network import SHIPPED_NETWORK
    from facade_core.parsing.segmenter import parse
    from training.parser import train as parser
    from training.parser.network_training import TrainingSchedule
    from training.parser.train import fine_tune_on_corrections

    course = TrainingSchedule(steps=1, per_step={"corrected": 2}, freeze_norms=True)
    with pytest.raises(InputError, match="pictures show 1 of 1"):
        fine_tune_on_corrections([facade()], tmp_path, seed=0, schedule=course)
    better = {SHIPPED_NETWORK: 0.5, tmp_path / "network.onnx": 0.5}
    monkeypatch.setattr(parser, "parser_pixel_accuracy", lambda photos, model: better[model])
    with pytest.raises(InputError, match=r"of 2 corrected facades .* 50\.0% .* nothing is kept"):
        fine_tune_on_corrections([facade()] * corrected_facades.MIN_FACADES, tmp_path, seed=0, schedule=course)
    assert not (tmp_path / "network.onnx").exists()
    better[tmp_path / "network.onnx"] = 0.6
    made = fine_tune_on_corrections([facade()] * corrected_facades.MIN_FACADES, tmp_path, seed=0, schedule=course)
    assert made == tmp_path / "network.onnx"
    assert parse(PAINTED.image, model=made).labels.shape == (HEIGHT, WIDTH)
    assert load_calibration(made) == load_calibration()
    assert read_model_record(made)["training_set"][-1] == "corrected/run/a-0"
    assert "| run | 8 |" in made.with_suffix(".md").read_text()
