"""A material goes on without a seam, at its own scale."""

from __future__ import annotations

import numpy as np
import pytest

from facade_core.core.errors import ImageError
from facade_core.street.materials.tiled_material import TiledMaterial, make_seamless


def grain(rows: int, columns: int, seed: int = 0) -> np.ndarray:
    """Smooth random grain with light that falls off to the right."""
    import cv2

    noise = np.random.default_rng(seed).normal(0, 60, (rows, columns, 1)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), 2.0)[..., None] * 4
    light = np.linspace(150, 90, columns)[None, :, None]
    return np.clip(smooth + light + np.zeros(3), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_steps_across_the_border_are_those_within(seed: int) -> None:
    image = grain(120, 160, seed)
    tile = make_seamless(image)
    inner = np.abs(np.diff(tile, axis=1)).mean()
    assert np.abs(tile[:, 0] - tile[:, -1]).mean() < 1.3 * inner
    assert np.abs(tile[0] - tile[-1]).mean() < 1.3 * np.abs(np.diff(tile, axis=0)).mean()
    # as it was, the border showed
    assert np.abs(image[:, 0].astype(float) - image[:, -1]).mean() > 3 * inner
    assert tile.shape == (90, 120, 3)
    assert tile.mean() == pytest.approx(image.mean(), abs=8)


def test_a_metre_of_the_material_is_a_metre_of_the_roof() -> None:
    """Bars 40 pixels apart, a centimetre each, are 0.4 m apart; from row to row of tiles they do not drift."""
    bars = np.where((np.arange(320) % 40 < 20)[None, :, None], 200, 60).astype(np.uint8)
    image = np.broadcast_to(bars, (240, 320, 3)).copy()
    material = TiledMaterial.from_picture(image, 0.01, 20.0)
    at = np.arange(0, 12, 0.01)
    line = material.sample(at, np.full(len(at), 3.3), np.full(len(at), 0.05))[:, 0]
    spectrum = np.abs(np.fft.rfft(line - line.mean()))
    assert np.fft.rfftfreq(len(line), 0.01)[spectrum.argmax()] == pytest.approx(2.5, abs=0.1)
    assert line.max() - line.min() > 80


def test_a_coarse_picture_is_interpolated_and_a_fine_one_averaged() -> None:
    flat = np.full((40, 40, 3), 90, np.uint8)
    for metres in (0.001, 1.0):
        colour = TiledMaterial.from_picture(flat, metres, 20.0).sample(
            np.linspace(-50, 50, 99), np.linspace(9, -70, 99), np.geomspace(0.01, 9, 99)
        )
        assert np.abs(colour - 90).max() < 1
    with pytest.raises(ImageError, match="larger picture"):
        TiledMaterial.from_picture(flat[:4], 0.01, 20.0)
