"""Recovered facades against the photos that were on the walls."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import EllipsisType
from typing import Any

import numpy as np

from benchmarks.painter.street_paint import replace_front_images
from benchmarks.painter.street_truth import SyntheticStreet, render_street_panorama, synthetic_street
from benchmarks.street.readings import Reading, View, blended, view_of
from facade_core.core.types import Pose
from facade_core.geometry.streets import Viewpoint
from facade_core.street.propagation.blend import blend_views
from facade_core.street.propagation.propagate import propagate_panorama
from facade_core.street.propagation.texel_buffer import TexelBuffer

TEXELS_PER_METRE = 20.0
SPACING_M, HEIGHT_M = 5.0, 2.5
WIDTH, SUPERSAMPLED = 1024, 2
SEEDS = (1, 2)
BUILDINGS = 8
# Standard deviations of a pose's error: metres on each axis, degrees of heading, pitch and roll.
POSE_ERRORS = {"exact poses": (0.0, 0.0), "5 cm, 0.2 deg": (0.05, 0.2), "15 cm, 0.5 deg": (0.15, 0.5)}
READINGS = {
    "average": Reading(gated=False, clamp="none"),
    "weighted, all views, divided by the sum": Reading(gated=False, clamp="sum"),
    "weighted, all views": Reading(gated=False),
    "weighted, gated": Reading(),
    "weighted, gated, divided by the sum": Reading(clamp="sum"),
    "weighted, all views, by resolution": Reading(gated=False, resolution=True),
    "weighted, gated, by resolution": Reading(resolution=True),
}
PINNED = "weighted, gated"


def measure(images: Path) -> dict[str, Any]:
    """PSNR by pose error and reading."""
    scores: dict[str, dict[str, list[float]]] = {name: {} for name in POSE_ERRORS}
    for seed in SEEDS:
        street = street_of_photos(images, seed)
        for name, errors in POSE_ERRORS.items():
            for reading, values in _recovered(street, errors, seed).items():
                scores[name].setdefault(reading, []).extend(values)
    return {
        name: {
            reading: interval(values) | {"above_pinned": interval(np.subtract(values, by_reading[PINNED]))}
            for reading, values in by_reading.items()
        }
        for name, by_reading in scores.items()
    } | {"facades": len(SEEDS) * BUILDINGS}


def street_of_photos(images: Path, seed: int) -> SyntheticStreet:
    """A synthetic street whose fronts show photos, with nothing before them."""
    from PIL import Image

    street = synthetic_street(BUILDINGS, seed=seed, occluders=0, texels_per_metre=TEXELS_PER_METRE)
    files = sorted(images.iterdir())
    chosen = np.random.default_rng(seed).choice(len(files), BUILDINGS, replace=False)
    return replace_front_images(street, [np.asarray(Image.open(files[index]).convert("RGB")) for index in chosen])


def _recovered(street: SyntheticStreet, errors: tuple[float, float], seed: int) -> dict[str, list[float]]:
    """PSNR of each facade by reading, from panoramas that were taken beside where they are believed to be."""
    import cv2

    scene, fronts = street.scene, list(street.charts)
    rng = np.random.default_rng(seed)
    window, views = _window(street), list[View]()
    latest = [np.zeros((facade.image.shape[0], facade.image.shape[1], 3), np.uint8) for facade in street.facades]
    forward = street.axis
    heading = float(np.degrees(np.arctan2(forward[0], forward[1])))
    for number, along in enumerate(np.arange(SPACING_M / 2, street.length, SPACING_M)):
        x, y = street.world_point(float(along), 0.0)
        off, turn = rng.normal(0, errors[0], 3), rng.normal(0, errors[1], 3)
        pose = Pose(x + off[0], y + off[1], HEIGHT_M + off[2], heading + turn[0], float(turn[1]), float(turn[2]))
        fine = render_street_panorama(street, pose, WIDTH * SUPERSAMPLED, seed=number)
        rgb = np.asarray(cv2.resize(fine, (WIDTH, WIDTH // 2), interpolation=cv2.INTER_AREA), np.uint8)
        viewpoint = Viewpoint(number, 0, np.array([x, y, HEIGHT_M]), forward)
        seen = scene.cast_panorama(viewpoint, WIDTH)[2]
        propagate_panorama(scene, window, viewpoint, rgb, charts_seen=seen)
        alone = _window(street)
        views.append(view_of(scene, alone, viewpoint, rgb, seen=seen))
        for front, image in zip(fronts, latest, strict=True):
            colour, count = _facade(street, alone, blend_views(alone.state), front)
            image[count > 0] = colour[count > 0]
    by_reading = {
        name: blend_views(window.state) if name == PINNED else blended(views, len(window.state.views), reading)
        for name, reading in READINGS.items()
    }
    found: dict[str, list[float]] = {"no blending, the latest view": []}
    for index, front in enumerate(fronts):
        truth = street.facades[index].image
        seen_at = _facade(street, window, by_reading[PINNED], front)[1] > 0
        found["no blending, the latest view"].append(psnr(latest[index], truth, seen_at))
        for name, result in by_reading.items():
            found.setdefault(name, []).append(psnr(_facade(street, window, result, front)[0], truth, seen_at))
    return found


def _window(street: SyntheticStreet) -> TexelBuffer:
    rasters, write = TexelBuffer.plan_layout(street.scene.placement, street.charts, street.charts)
    seed, evidence = np.zeros((rasters.total, 3), np.uint8), np.zeros(rasters.total, np.uint8)
    return TexelBuffer.allocate(street.scene.placement, rasters, write, seed, evidence)


def _facade(
    street: SyntheticStreet, window: TexelBuffer, result: tuple[np.ndarray, np.ndarray], chart: int
) -> tuple[np.ndarray, np.ndarray]:
    """A facade's colour (h, w, 3) and views (h, w), of those of the window's texels."""
    placement = street.scene.placement
    colour, views = (values[window.layout.texel_slice(placement, chart)] for values in result)
    shape = placement.shape(chart)
    return colour.reshape(*shape, 3), views.reshape(shape)


def psnr(image: np.ndarray, truth: np.ndarray, where: np.ndarray | EllipsisType) -> float:
    error = image[where].astype(np.float64) - truth[where]
    return float(10 * np.log10(255**2 / np.mean(error**2)))


def interval(values: Sequence[float] | np.ndarray) -> dict[str, float]:
    """Mean and the 95 % bootstrap interval of it."""
    sample = np.asarray(values)
    means = sample[np.random.default_rng(0).integers(0, len(sample), (2000, len(sample)))].mean(axis=1)
    low, high = np.quantile(means, [0.025, 0.975])
    return {"mean": round(float(sample.mean()), 2), "low": round(float(low), 2), "high": round(float(high), 2)}
