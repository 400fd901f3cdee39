"""What the benchmarks of inpainting and synthesis measure with: holes, figures, and resizing without knowledge of facades."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.inpainting import goals, main, similarity, structure
from benchmarks.inpainting.cases import Case, hole
from benchmarks.synthesis.resizing import carve, quilt
from facade_core.core.labels import UNKNOWN, FacadeClass

PIECES = {
    "tree_1": np.full((60, 40), 255, np.uint8),
    "car_1": np.full((20, 50), 255, np.uint8),
    "ppl_1": np.full((50, 15), 255, np.uint8),
}


def picture(height: int = 90, width: int = 120) -> np.ndarray:
    return np.random.default_rng(0).integers(0, 255, (height, width, 3), np.uint8)


def test_holes_stand_on_the_bottom_and_hide_what_is_asked():
    for seed in range(6):
        mask = hole((300, 200), PIECES, np.random.default_rng(seed))
        assert 0.05 < mask.mean() <= 0.30
        assert mask[-1].any()
        assert not mask[:60].any()
        np.testing.assert_array_equal(mask, hole((300, 200), PIECES, np.random.default_rng(seed)))


def test_figures_of_the_truth_and_of_a_blur():
    truth, mask = picture(), np.zeros((90, 120), bool)
    mask[20:60, 30:80] = True
    same = similarity(truth, truth, mask)
    assert same["ssim"] == pytest.approx(1.0)
    assert same["gradient_energy"] == pytest.approx(1.0)
    flat = np.where(mask[..., None], 127, truth).astype(np.uint8)
    assert similarity(flat, truth, mask)["gradient_energy"] < 0.2
    assert similarity(flat, truth, mask)["psnr"] < 15


def test_goals_compare_with_sharp_peers_only():
    row = {"psnr": 14.0, "ssim": 0.3, "perceptual": 1.0, "gradient_energy": 1.0, "structure_miou": 0.4}
    blur = {**row, "psnr": 20.0, "gradient_energy": 0.2}
    ours = {**row, "psnr": 15.5, "perceptual": 0.8, "structure_miou": 0.55}
    found = goals({"telea": blur, "shift_map": row, "floors + layout": ours})
    assert found["sharp_peers"] == ["shift_map"]
    assert found["psnr_gain"] == 1.5
    assert found["perceptual_ratio"] == 0.8
    assert found["structure_gain"] == 15.0
    bare = [{key: value for key, value in one.items() if key != "perceptual"} for one in (row, ours)]
    assert goals({"shift_map": bare[0], "floors + layout": bare[1]})["perceptual_ratio"] is None


def test_a_method_that_is_none_is_refused(capsys):
    with pytest.raises(SystemExit):
        main(["--methods", "florrs"])
    assert "florrs" in capsys.readouterr().err


def test_hidden_rows_and_doors_are_counted_in_holes():
    labels, mask = np.zeros((4, 20), np.uint8), np.zeros((4, 20), bool)
    mask[2], mask[3, 1:] = True, True  # a row of which nothing is seen, and one of which a twentieth is
    mask[1, :10] = True
    labels[1:, 4:8] = FacadeClass.DOOR
    labels[3, 19] = UNKNOWN
    parsed = np.zeros_like(labels)
    parsed[2, 4:6] = parsed[2, 12] = FacadeClass.DOOR
    found = structure([Case("one", np.zeros((4, 20, 3), np.uint8), labels, mask)], [parsed])
    assert found["hidden_rows"] == pytest.approx((20 - 3 + 18 - 4) / 38, abs=1e-3)
    assert found["door_recall"] == pytest.approx(2 / 12, abs=1e-3)
    assert found["door_precision"] == pytest.approx(2 / 3, abs=1e-3)
    assert (
        structure([Case("none", np.zeros((4, 20, 3), np.uint8), labels, mask & False)], [parsed])["door_recall"] is None
    )


@pytest.mark.parametrize("size", [(70, 150), (120, 100), (90, 300)])
def test_quilting_and_carving_give_the_size(size):
    assert carve(picture(), size).shape == (*size, 3)
    assert quilt(picture(), size, np.random.default_rng(0)).shape == (*size, 3)


def test_carving_takes_what_is_flat():
    image = np.full((30, 40, 3), 100, np.uint8)
    image[:, :10] = picture(30, 10)
    np.testing.assert_array_equal(carve(image, (30, 30))[:, :9], image[:, :9])
