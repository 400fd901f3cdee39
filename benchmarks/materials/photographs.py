"""Grain beside the photographs that it is from: gradients' energy at texels of several densities, and repeats."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from benchmarks.materials import _gradients
from facade_core.street.materials.grain import EXAMPLE_NAMES, GrainTables, WeightedGrain, add_grain, build_grain_tables
from facade_core.street.materials.grain_file import load_examples
from training.materials import GRAIN_PHOTOS, read_picture_and_digest

DENSITIES = (8, 16, 32, 64)
# Metres along a patch; of the one in which repeats are looked for, at so many texels a metre.
PATCH_M, WIDE_M, WIDE_DENSITY = 4.0, 16.0, 32
SEED = 3


def against_photographs(data: Path) -> dict[str, dict[str, float]]:
    """By example: the energy over the photograph's at each density; the largest correlation where a tile would begin again."""
    found: dict[str, dict[str, float]] = {}
    examples = load_examples()
    drawn = build_grain_tables([WeightedGrain(examples[name]) for name in EXAMPLE_NAMES])
    for which, name in enumerate(EXAMPLE_NAMES):
        file, width, _ = GRAIN_PHOTOS[name]
        photo = read_picture_and_digest(data / "materials" / file)[0].mean(axis=2)
        photo /= photo.mean()
        own = {}
        for density in DENSITIES:
            side = max(2, round(width * density))
            high = max(2, round(side * photo.shape[0] / photo.shape[1]))
            seen = cv2.resize(photo, (side, high), interpolation=cv2.INTER_AREA)
            own[f"energy at {density}"] = round(
                _gradients(_patch(drawn, which, density, PATCH_M)) / _gradients(seen), 2
            )
        tone = _patch(drawn, which, WIDE_DENSITY, WIDE_M)
        tone -= tone.mean()
        correlation = np.fft.irfft2(np.abs(np.fft.rfft2(tone)) ** 2, tone.shape)
        period = round(width * WIDE_DENSITY)
        own["repeats"] = round(float(np.abs(correlation[[0, period], [period, 0]]).max() / correlation[0, 0]), 3)
        found[name] = own
    return found


def _patch(drawn: GrainTables, which: int, density: float, metres: float) -> np.ndarray:
    count = round(metres * density)
    x, y = (a.ravel() for a in np.meshgrid(*[(np.arange(count) + 0.5) / density] * 2))
    out = np.ones(len(x))
    add_grain(x, y, np.full(len(x), 1 / density), drawn, which, 1.0, SEED, out)
    return out.reshape(count, count)
