"""The neural translator: the first convolution on the sphere, bands that are equal to the whole, and broken files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from facade_core.core.errors import ModelFileError
from facade_core.street.translator import neural_translator
from facade_core.street.translator.equirectangular_taps import KERNEL_SIZE, TAP_COUNT, gather_taps, kernel_taps
from facade_core.street.translator.training_views import (
    PANORAMA_WIDTHS,
    USED_ROWS,
    TrainingRendering,
    imitate_rendering,
    random_panorama_crop,
    random_rendering_crop,
)

RNG = np.random.default_rng(3)


def smooth(height: int) -> np.ndarray:
    """A panorama without detail finer than ten pixels, (h, 2 h, 3) uint8."""
    import cv2

    coarse = RNG.integers(0, 255, (height // 8, height // 4, 3), dtype=np.uint8)
    return cv2.resize(np.concatenate([coarse, coarse[:, :1]], 1), (2 * height, height), interpolation=cv2.INTER_CUBIC)


def test_at_the_equator_the_taps_are_the_pixels_around() -> None:
    rows, columns = kernel_taps(256)
    down, right = np.divmod(np.arange(TAP_COUNT), KERNEL_SIZE)
    for row in (127, 128):
        np.testing.assert_allclose(rows[row], row + down - KERNEL_SIZE // 2, atol=0.02)
        np.testing.assert_allclose(columns[row], right - KERNEL_SIZE // 2, atol=0.02)
    plane = RNG.random((1, 256, 512), np.float32)
    around = np.stack([np.roll(plane[0, 127 + dy], -dx) for dy in range(-3, 4) for dx in range(-3, 4)])
    np.testing.assert_allclose(gather_taps(plane, (127, 128))[:, 0], around, atol=0.03)


def test_towards_the_poles_the_taps_spread_as_the_meridians_close_in() -> None:
    _, columns = kernel_taps(256)
    at_60_degrees = columns[round(256 / 6)].reshape(KERNEL_SIZE, KERNEL_SIZE)[KERNEL_SIZE // 2]
    np.testing.assert_allclose(at_60_degrees, 2 * np.arange(-3, 4), rtol=0.03, atol=0.05)
    rows, columns = kernel_taps(64)
    assert rows.min() >= -0.5
    assert rows.max() <= 63.5
    assert np.abs(columns[0]).max() > 32  # beyond the zenith is the other side


def test_a_turned_panorama_is_seen_turned() -> None:
    plane = RNG.random((2, 32, 64), np.float32)
    turned = gather_taps(np.ascontiguousarray(np.roll(plane, 17, axis=2)), (0, 32))
    np.testing.assert_array_equal(turned, np.roll(gather_taps(plane, (0, 32)), 17, axis=2))


@pytest.mark.long
def test_tiles_are_equal_to_the_whole_and_there_is_no_seam_at_180_degrees(monkeypatch: pytest.MonkeyPatch) -> None:
    network, image = neural_translator.load_translator(), smooth(256)
    whole = network.translate_image(image)
    assert whole.std() > 5
    assert (network.translate_image(np.roll(image, 200, axis=1)) == np.roll(whole, 200, axis=1)).all()
    monkeypatch.setattr(neural_translator, "MAX_NETWORK_PIXELS", (2 * neural_translator.RECEPTIVE_MARGIN + 100) ** 2)
    assert (network.translate_image(image) == whole).all()


def test_a_far_change_changes_nothing() -> None:
    network, image = neural_translator.load_translator(), smooth(256)
    changed = image.copy()
    changed[-20:] = 255 - changed[-20:]
    before, after = network.translate_image(image), network.translate_image(changed)
    assert (before != after).any()
    assert (
        before[: 256 - 20 - neural_translator.RECEPTIVE_MARGIN]
        == after[: 256 - 20 - neural_translator.RECEPTIVE_MARGIN]
    ).all()


def test_a_width_the_network_does_not_take_is_refused() -> None:
    with pytest.raises(ModelFileError, match=r"100 pixels wide.*change panorama_width"):
        neural_translator.load_translator().translate_image(np.zeros((50, 100, 3), np.uint8))


def test_broken_files_are_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(ModelFileError, match=r"none\.onnx: no such file"):
        neural_translator.load_translator(tmp_path / "none.onnx")
    path = tmp_path / "t.onnx"
    record = json.loads(neural_translator.SHIPPED_TRANSLATOR.with_suffix(".json").read_text())
    path.write_bytes(neural_translator.SHIPPED_TRANSLATOR.read_bytes()[:-1])
    path.with_suffix(".json").write_text(json.dumps(record))
    with pytest.raises(ModelFileError, match="checksum differs"):
        neural_translator.load_translator(path)
    neural_translator.write_translator(b"not a network", path, {"version": neural_translator.TRANSLATOR_VERSION})
    with pytest.raises(ModelFileError, match="not a model that onnxruntime reads"):
        neural_translator.load_translator(path)
    neural_translator.write_translator(neural_translator.SHIPPED_TRANSLATOR.read_bytes(), path, {"version": 0})
    with pytest.raises(ModelFileError, match="another version"):
        neural_translator.load_translator(path)
    path.with_suffix(".json").write_text("[]")
    with pytest.raises(ModelFileError, match="not the record of a translator"):
        neural_translator.load_translator(path)


def test_crops_show_the_street_and_know_where_they_are() -> None:
    grey = np.repeat(np.arange(512, dtype=np.uint16)[:, None] // 2, 1024, 1).astype(np.uint8)
    views = [TrainingRendering(grey, grey > 100)]
    rng, places, known = np.random.default_rng(0), set(), 0
    for _ in range(40):
        crop = random_rendering_crop(views, (64, 128), rng)
        first, height = crop.place
        assert crop.image.shape == (64, 128, 3)
        assert height in [width // 2 for width in PANORAMA_WIDTHS]
        assert USED_ROWS[0] * height - 1 <= first
        assert first + 64 <= USED_ROWS[1] * height + 1
        np.testing.assert_allclose(crop.image[0, 0], first / height * 256, atol=3)
        places.add(height)
        known += bool(crop.textured.any())
    assert len(places) == len(PANORAMA_WIDTHS)
    assert 0 < known < 40
    photo = random_panorama_crop([np.repeat(grey[..., None], 3, 2)], (64, 128), rng)
    assert not photo.textured.any()


def test_a_real_crop_without_its_detail_looks_like_a_rendering() -> None:
    photo = np.zeros((60, 80, 3), np.uint8)
    photo[:20] = (180, 200, 240)
    photo[20:] = RNG.integers(40, 60, (40, 80, 1))
    photo[30:40, 20:30] = 20
    grey = imitate_rendering(photo)
    assert (grey[:18] == 0).all()
    assert grey[22:].min() >= 100
    assert grey[35, 25] < grey[50, 60] - 20
    steps = [np.abs(np.diff(image[45:55, 50:70].astype(int))).mean() for image in (grey, photo[..., 0])]
    assert steps[0] < steps[1]
