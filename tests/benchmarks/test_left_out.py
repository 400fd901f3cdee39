"""What is compared of a panorama left out: likeness, exposure aside, and paths of a block file that is copied."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.left_out import MADE, Compared, _absolute, _factor, _likeness


def view(made: np.ndarray, real: np.ndarray) -> Compared:
    everywhere = np.ones(real.shape[:2], bool)
    return Compared(real, everywhere, dict.fromkeys(MADE, made), {"all": everywhere})


def test_the_same_picture_in_another_exposure_is_the_same() -> None:
    rng = np.random.default_rng(1)
    real = np.kron(rng.integers(60, 200, (8, 8, 3)), np.ones((8, 8, 1))).astype(np.uint8)
    darker = (real * np.array([0.5, 0.6, 0.7])).round().astype(np.uint8)
    compared = view(darker, real)
    factors = {made: _factor([compared], made) for made in MADE}
    np.testing.assert_allclose(factors["ours"], 1 / np.array([0.5, 0.6, 0.7]), rtol=0.02)
    told = _likeness(compared, factors, compared.regions["all"])
    assert told["ours psnr"] > 45
    assert told["ours ssim"] > 0.99
    assert told["ours gmsd"] < 0.01


def test_another_picture_is_less_like() -> None:
    rng = np.random.default_rng(2)
    real, other = (rng.integers(0, 255, (64, 64, 3), dtype=np.uint8) for _ in range(2))
    compared = view(other, real)
    told = _likeness(compared, dict.fromkeys(MADE, np.ones(3)), compared.regions["all"])
    assert told["ours psnr"] < 12
    assert told["ours ssim"] < 0.2
    assert told["ours gmsd"] > 0.1


def test_paths_of_a_block_file_are_those_of_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "houses.obj").touch()
    monkeypatch.setenv("SOMEWHERE", str(tmp_path))
    stated = {"name": "in a name", "buildings": {"path": ["houses.obj", "${SOMEWHERE}/in"]}, "seed": 7}
    found = _absolute(stated, tmp_path)
    assert found == {
        "name": "in a name",
        "buildings": {"path": [str(tmp_path / "houses.obj"), f"{tmp_path}/in"]},
        "seed": 7,
    }
