"""Similarity of grains by the contrast of their octaves and directions, and by their colours."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.core.arrays import FloatArray
from facade_core.export.factored.image_quilting import WallGrain
from facade_core.export.factored.settings import WALL_GRAINS


def find_representative_grains(grains: Sequence[WallGrain]) -> list[int]:
    """Return, for each grain, the index of the grain that represents its group.

    The representative is the most even grain of the finest resolution, so that no mark of one wall repeats on others.
    """
    descriptors = [_grain_descriptor(grain) for grain in grains]
    fine = [grain.relative_light.shape[0] / grain.width_m for grain in grains]
    coarse = [-round(np.log2(density)) for density in fine]
    groups: dict[int, list[int]] = {}
    for number in sorted(range(len(grains)), key=lambda k: (coarse[k], k)):
        off = {k: _descriptor_distance(descriptors[number], descriptors[k]) for k in groups}
        nearest = min(off, key=lambda k: (off[k], k), default=number)
        groups.setdefault(nearest if off.get(nearest, 0) <= 1 else number, []).append(number)
    found = list(range(len(grains)))
    for group in groups.values():
        representative = min(group, key=lambda k: (coarse[k], _unevenness(grains[k]), k))
        for number in group:
            found[number] = representative
    return found


def _unevenness(grain: WallGrain) -> float:
    """Return the contrast of a grain's strongest part relative to the median part."""
    light = np.sqrt(grain.relative_light).mean(axis=2)
    step = len(light) // WALL_GRAINS.evenness_parts
    if step == 0:  # plain colour
        return 1.0
    parts = np.square(light - light.mean())[
        : step * WALL_GRAINS.evenness_parts, : step * WALL_GRAINS.evenness_parts
    ].reshape(WALL_GRAINS.evenness_parts, step, WALL_GRAINS.evenness_parts, step)
    energy = parts.mean(axis=(1, 3))
    return float(energy.max() / max(float(np.median(energy)), 1e-9))


def _grain_descriptor(grain: WallGrain) -> tuple[FloatArray, FloatArray]:
    """Return amplitudes (octaves, directions) of a grain's light, and the deviation (2,) of red and blue from it."""
    root = np.sqrt(grain.relative_light)
    light = root.mean(axis=2)
    side = len(light)
    power = np.square(np.abs(np.fft.fft2(light - light.mean()))) / side**4
    waves = np.fft.fftfreq(side, grain.width_m / side)
    y, x = np.meshgrid(waves, waves, indexing="ij")
    octave = np.digitize(np.hypot(x, y), WALL_GRAINS.octave_borders[1:-1])
    direction = np.rint(np.arctan2(y, x) / np.pi * WALL_GRAINS.directions).astype(int) % WALL_GRAINS.directions
    sums = np.bincount(
        (octave * WALL_GRAINS.directions + direction).ravel(),
        power.ravel(),
        (len(WALL_GRAINS.octave_borders) - 1) * WALL_GRAINS.directions,
    ).reshape(-1, WALL_GRAINS.directions)
    return np.sqrt(sums), (root[..., [0, 2]] - light[..., None]).std(axis=(0, 1))


def _descriptor_distance(one: tuple[FloatArray, FloatArray], other: tuple[FloatArray, FloatArray]) -> float:
    """Return the distance of two grains; 1 or less means similar."""
    off = np.sqrt(sum(float(np.square(a - b).sum()) for a, b in zip(one, other, strict=True)))
    weaker = min(np.sqrt(float(np.square(amplitudes).sum())) for amplitudes, _ in (one, other))
    return float(off / max(WALL_GRAINS.min_grain_distance, WALL_GRAINS.max_distance_share * weaker))
