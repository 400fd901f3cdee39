"""Photos that show one wall from two places, laid over each other: nothing changed between them but where they were taken."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.changes.pairs import Pair
from facade_core.core.labels import UNKNOWN, FacadeClass
from facade_core.imagery.rectify.fusion import ChartView
from facade_core.parsing.occluders import clean_occluder_mask
from facade_core.parsing.segmenter import parse
from training.datasets.facades import RUEMONGE, LabelledFacade, read_dataset

# Matches that a plane explains, at least; share of the first photo that both then show.
LEAST_MATCHES, LEAST_SHARED = 60, 0.4
# Texels a metre that are assumed: 1067 pixels show 20 m.
DENSITY = 50.0


def real_pairs(folder: Path) -> Iterator[tuple[str, Pair]]:
    """Neighbouring photos by pairs: as they are, and with a part of another wall laid over the later."""
    photos = sorted(read_dataset(RUEMONGE, folder), key=lambda one: one.name)
    rng = np.random.default_rng(2)
    for first, second in zip(photos[::2], photos[1::2], strict=False):
        older = _view(first, None, first)
        warp = _plane(first.image, second.image)
        if warp is None:
            continue
        newer = _view(second, warp, first)
        both = newer.clear & older.clear
        if both.mean() < LEAST_SHARED:
            continue
        yield "nothing", Pair(newer, older, DENSITY, np.zeros(both.shape, bool))
        other = photos[int(rng.integers(len(photos)))].image
        rows = len(both)
        share, at = rng.uniform(0.3, 0.7), rng.uniform(0, 0.3)
        top, bottom = round(at * rows), round((at + share) * rows)
        if other.shape != first.image.shape:
            continue
        rgb, changed = newer.rgb.copy(), np.zeros(both.shape, bool)
        rgb[top:bottom], changed[top:bottom] = other[top:bottom], True
        yield "storeys", Pair(ChartView(rgb, newer.seen, newer.quality, newer.occluded), older, DENSITY, changed)


def _view(photo: LabelledFacade, warp: np.ndarray | None, like: LabelledFacade) -> ChartView:
    """A photo laid over another; sky and what is not labelled are not shown, nor what the parser sees in front."""
    import cv2

    hidden, _ = clean_occluder_mask(parse(photo.image).occluded)
    wall = (photo.labels != FacadeClass.SKY) & (photo.labels != UNKNOWN)
    rgb, quality = photo.image, np.ones(like.labels.shape, np.float32)
    if warp is not None:
        size = like.labels.shape[::-1]
        rgb = np.asarray(cv2.warpPerspective(rgb, warp, size, flags=cv2.INTER_LINEAR), np.uint8)
        hidden, wall = (
            cv2.warpPerspective(mask.astype(np.uint8), warp, size, flags=cv2.INTER_NEAREST).astype(bool)
            for mask in (hidden, wall)
        )
    return ChartView(rgb, wall, quality, hidden)


def _plane(first: np.ndarray, second: np.ndarray) -> np.ndarray | None:
    """Where the second photo's pixels lie on the first, by the plane that most matches agree on (3, 3); None without one."""
    import cv2

    cv2.setRNGSeed(0)
    sift = cv2.SIFT.create(4000)
    (one, of_one), (two, of_two) = (
        sift.detectAndCompute(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), None) for image in (first, second)
    )
    found = cv2.BFMatcher().knnMatch(of_two, of_one, k=2)
    good = [near for near, next_ in found if near.distance < 0.75 * next_.distance]
    if len(good) < LEAST_MATCHES:
        return None
    source = np.array([two[m.queryIdx].pt for m in good], np.float32)
    target = np.array([one[m.trainIdx].pt for m in good], np.float32)
    warp, kept = cv2.findHomography(source, target, cv2.RANSAC, 3.0)
    return None if warp is None or kept.sum() < LEAST_MATCHES else np.asarray(warp)
