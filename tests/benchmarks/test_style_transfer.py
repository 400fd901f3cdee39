"""The style of a city classified from views: squares of wall, real pictures along a street, and shares of scores."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yaml

from benchmarks.painter.facade import paint_facade
from benchmarks.style_transfer import SQUARE_PX, cut_squares, see_along_street, summarise_scores, write_block
from training.datasets.facades import LabelledFacade


def test_squares_show_walls_only() -> None:
    is_wall = np.zeros((300, 400), bool)
    is_wall[:, :100] = True
    squares = cut_squares(np.full((300, 400, 3), 7, np.uint8), is_wall)
    assert squares.shape[1:] == (SQUARE_PX, SQUARE_PX, 3)
    assert 1 <= len(squares) <= 5
    assert cut_squares(np.zeros((300, 400, 3), np.uint8), np.zeros_like(is_wall)).shape == (0, SQUARE_PX, SQUARE_PX, 3)


def test_a_picture_is_seen_along_a_street_in_its_colours() -> None:
    painted = paint_facade((30.0, 20.0), floors=6, columns=9, style="brick", metres_per_pixel=0.05, seed=2)
    empty = np.zeros_like(painted.labels)
    facade = LabelledFacade("painted", painted.image, painted.labels, empty, empty, empty)
    squares = np.concatenate([see_along_street(facade, np.random.default_rng(seed)) for seed in range(4)])
    assert len(squares)
    assert np.abs(squares.mean(axis=(0, 1, 2)) - painted.image.mean(axis=(0, 1))).max() < 20


def test_shares_are_of_the_style_asked_for() -> None:
    found = summarise_scores(np.array([[-2.0, 1.0, -1.0], [-1.0, -0.5, 1.0], [0.5, 2.0, 1.0], [-1.0, 1.0, 1.0]]))
    assert found == {
        "views": 4,
        "recall_first": 0.75,
        "recall_second": 0.75,
        "balanced_accuracy": 0.75,
        "balanced_accuracy_centred": 0.75,
        "ordered": 1.0,
        "default_as_first": 0.25,
        "default_as_first_centred": 0.25,
    }


def test_a_block_harvests_copies_of_its_pictures(tmp_path: Path) -> None:
    picture = tmp_path / "a.jpg"
    picture.write_bytes(b"picture")
    stated = yaml.safe_load(write_block(tmp_path / "styled", tmp_path, [picture]).read_text(encoding="utf-8"))
    assert (Path(stated["imagery"]["style"]["path"]) / "a.jpg").read_bytes() == b"picture"
    assert "imagery" not in yaml.safe_load(write_block(tmp_path / "bare", tmp_path, []).read_text(encoding="utf-8"))
