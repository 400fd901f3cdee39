"""Colours of a synthetic street: patterned ground and walls, and photos on its facades."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from benchmarks.painter.street_truth import STREET_ORIGIN_M, GroundPaint, SidePaint, SyntheticStreet
from facade_core.core.arrays import Float32Array, Float64Array, IntArray, UInt8Array
from facade_core.geometry.charts import ChartKind


def ground_pattern_painter(street: SyntheticStreet) -> GroundPaint:
    """Return a function that paints ground points with a pattern unlike any material."""
    rng = np.random.default_rng(5)
    grains = [(side, rng.normal(0, 1, (97, 89))) for side in (3.1, 0.7, 0.21, 0.06)]
    across = np.array([-street.axis[1], street.axis[0]])

    def paint(places: Float64Array) -> Float32Array:
        along, aside = (places - STREET_ORIGIN_M) @ street.axis, (places - STREET_ORIGIN_M) @ across
        noise = np.zeros(len(places))
        for weight, (side, values) in zip((9, 7, 6, 5), grains, strict=True):
            noise += weight * values[(along // side % 97).astype(int), (aside // side % 89).astype(int)]
        road = np.abs(aside) < 4.5
        kerb = np.abs(np.abs(aside) - 4.6) < 0.1
        joint = (along % 0.9 < 0.04) | (aside % 0.6 < 0.03)
        line = (np.abs(aside) < 0.08) & (along % 3.0 < 1.5)
        patch = (along % 11 < 3.2) & (aside > 0.6) & (aside < 2.9)
        grey = np.where(road, np.where(patch, 62.0, 92.0), np.where(joint, 96.0, 148.0))
        grey = np.where(kerb, 170.0, np.where(line, 214.0, grey)) + noise
        tint = np.where(road[:, None], [1.0, 1.0, 1.03], [1.0, 0.95, 0.88])
        painted: Float32Array = np.clip(grey[:, None] * tint, 0, 255).astype(np.float32)
        return painted

    return paint


def side_pattern_painter(street: SyntheticStreet) -> SidePaint:
    """Return a function that paints side walls and roofs with a pattern unlike any material.

    Bricks, worn plaster and courses of tiles; each building has its own tones and stains, and some charts have a patch.
    """
    rng = np.random.default_rng(6)
    charts = street.scene.charts
    grains = [(side, rng.normal(0, 1, (97, 89))) for side in (2.3, 0.6, 0.17, 0.06)]
    houses = int(charts.building.max()) + 1
    tone = rng.uniform(90, 180, (houses, 1)) * rng.uniform([0.95, 0.85, 0.75], [1.1, 1.0, 0.95], (houses, 3))
    patched = rng.uniform(0, 1, (len(charts), 3))

    def paint(chart: IntArray, x: Float64Array, y: Float64Array) -> Float32Array:
        noise = np.zeros(len(chart))
        for weight, (side, values) in zip((0.04, 0.025, 0.02, 0.03), grains, strict=True):
            noise += weight * values[((x + 7 * chart) // side % 97).astype(int), (y // side % 89).astype(int)]
        row = (y // 0.1).astype(int)
        joint = (y % 0.1 < 0.015) | ((x + 0.12 * (row % 2)) % 0.24 < 0.015)
        course = 0.85 + 0.3 * (y % 0.33) / 0.33 - 0.15 * (x % 0.3 < 0.03)
        roof, brick = charts.kind[chart] == ChartKind.ROOF, charts.building[chart] % 2 == 0
        share = np.where(roof, course, np.where(brick & joint, 1.25, 1.0)) + noise
        width, height = charts.size[chart].T
        left, top = patched[chart, 0] * width, patched[chart, 1] * height
        patch = (patched[chart, 2] < 0.6) & (x > left) & (x < left + 2.2) & (y > top) & (y < top + 1.4)
        share = np.where(patch, 0.55 * share, share)
        base = np.where(roof[:, None], tone[charts.building[chart]] * [0.8, 0.65, 0.6], tone[charts.building[chart]])
        return np.clip(base * share[:, None], 0, 255).astype(np.float32)

    return paint


def replace_front_images(street: SyntheticStreet, photos: Sequence[UInt8Array]) -> SyntheticStreet:
    """Return the street with photos on its facades.

    Parameters
    ----------
    street : the street.
    photos : (h, w, 3) uint8 per facade, in their order; resized to the facades.
    """
    import cv2

    painted = []
    for facade, photo in zip(street.facades, photos, strict=True):
        size = (facade.image.shape[1], facade.image.shape[0])
        image = np.asarray(cv2.resize(photo, size, interpolation=cv2.INTER_AREA), np.uint8)
        painted.append(replace(facade, image=image))
    return replace(street, facades=tuple(painted))
