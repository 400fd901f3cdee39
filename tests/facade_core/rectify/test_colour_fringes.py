"""Colour fringes of edges go; colours of areas and luminance stay."""

from __future__ import annotations

import numpy as np

from facade_core.imagery.rectify.colour_fringes import BAND_ROWS, remove_colour_fringes


def chroma(image: np.ndarray) -> np.ndarray:
    """Largest difference between two channels of each pixel."""
    values = image.astype(int)
    return values.max(axis=2) - values.min(axis=2)


def test_fringes_of_shifted_channels_go() -> None:
    bars = np.where(np.arange(120) // 20 % 2, 200, 60).astype(np.uint8)
    image = np.stack([np.roll(bars, -1), bars, np.roll(bars, 1)], axis=1)[None].repeat(64, axis=0)
    found = remove_colour_fringes(image)
    assert chroma(image).max() == 140
    assert chroma(found)[:, 10:-10].max() < 70
    luma = [one @ [0.299, 0.587, 0.114] for one in (image, found)]
    assert np.abs(luma[0] - luma[1]).max() < 4


def test_colours_of_areas_stay_across_bands() -> None:
    image = np.full((BAND_ROWS + 40, 80, 3), (150, 70, 60), np.uint8)
    image[:, 40:] = (90, 110, 160)
    found = remove_colour_fringes(image).astype(int)
    off = np.abs(found - image)
    assert off[:, :28].max() <= 2
    assert off[:, 52:].max() <= 2
    assert np.ptp(found, axis=0).max() <= 2, "bands join without a seam"
