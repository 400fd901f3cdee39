"""Training data of the translator: crops of painted street renderings and of real pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.papers.translator.colour_grid import NETWORK_HEIGHT, REDUCTION, TRAINED_ROWS
from facade_core.core.arrays import BoolArray, UInt8Array

PANORAMA_HEIGHT = NETWORK_HEIGHT * REDUCTION
# Crop in rows and columns: what a photo of PHOTO_FIELD_OF_VIEW fills, and both multiples of the network's cells.
CROP = (96, 160)
# Horizontal field of view that a photo without stated camera is taken to have, degrees.
PHOTO_FIELD_OF_VIEW = 60.0
# Share of renderings that are taken as nothing had been translated before.
_FIRST_SHARE = 0.25


@dataclass(frozen=True, slots=True)
class TrainingRendering:
    """Painted rendering of a viewpoint.

    Attributes
    ----------
    image : (h, w, 3) uint8, painted by the material field where nothing is given.
    given : (h, w) bool, pixels whose colours are given: facades, photos and the sky.
    earlier : (h, w) bool, other pixels that earlier viewpoints have translated.
    """

    image: UInt8Array
    given: BoolArray
    earlier: BoolArray


@dataclass(frozen=True, slots=True)
class RealPicture:
    """Real panorama, or a photo resampled to the place in a panorama that it would take.

    Attributes
    ----------
    image : (h, w, 3) uint8; a panorama is PANORAMA_HEIGHT high.
    top : row of a panorama that the first one is; None for a whole panorama.
    """

    image: UInt8Array
    top: int | None = None


@dataclass(frozen=True, slots=True)
class TrainingCrop:
    """Crop of a panorama.

    Attributes
    ----------
    image : (h, w, 3) uint8.
    given, earlier : (h, w) bool, as in `TrainingRendering`.
    place : first row and height of the panorama, in pixels of the network.
    """

    image: UInt8Array
    given: BoolArray
    earlier: BoolArray
    place: tuple[int, int]


def random_rendering_crop(renderings: Sequence[TrainingRendering], rng: np.random.Generator) -> TrainingCrop:
    """Take a random crop of a random rendering, possibly mirrored, with earlier texture or without."""
    chosen = renderings[int(rng.integers(len(renderings)))]
    earlier = np.zeros_like(chosen.earlier) if rng.random() < _FIRST_SHARE else chosen.earlier
    return _cut_crop(chosen.image, chosen.given, earlier, rng)


def random_real_crop(pictures: Sequence[RealPicture], rng: np.random.Generator) -> TrainingCrop:
    """Take a random crop of a random real picture, possibly mirrored."""
    chosen = pictures[int(rng.integers(len(pictures)))]
    nothing = np.zeros(chosen.image.shape[:2], bool)
    if chosen.top is None:
        return _cut_crop(chosen.image, nothing, nothing, rng)
    image = chosen.image[:, ::-1] if rng.random() < 0.5 else chosen.image
    return TrainingCrop(image, nothing, nothing, (chosen.top // REDUCTION, NETWORK_HEIGHT))


def resample_photo(photo: UInt8Array) -> RealPicture:
    """Resample the middle of a photo to CROP of a panorama around the horizon."""
    import cv2

    height, width = photo.shape[:2]
    focal = width / 2 / np.tan(np.radians(PHOTO_FIELD_OF_VIEW / 2))
    rows, columns = CROP
    longitude = (np.arange(columns) + 0.5 - columns / 2) * (np.pi / PANORAMA_HEIGHT)
    latitude = (rows / 2 - np.arange(rows) - 0.5)[:, None] * (np.pi / PANORAMA_HEIGHT)
    right = np.broadcast_to(np.tan(longitude), (rows, columns))
    up = np.tan(latitude) / np.cos(longitude)
    # a photo lower than the crop is shown larger
    scale = min(1.0, (height / 2) / (focal * float(up.max())))
    # reduced first, so that a pixel of the panorama is the mean of those that it covers
    reduction = max(1.0, focal * scale * np.pi / PANORAMA_HEIGHT)
    small = cv2.resize(
        photo, (max(1, round(width / reduction)), max(1, round(height / reduction))), interpolation=cv2.INTER_AREA
    )
    x = (width / 2 + focal * scale * right) * (small.shape[1] / width) - 0.5
    y = (height / 2 - focal * scale * up) * (small.shape[0] / height) - 0.5
    image = cv2.remap(
        small, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return RealPicture(np.asarray(image, np.uint8), (PANORAMA_HEIGHT - rows) // 2)


def _cut_crop(image: UInt8Array, given: BoolArray, earlier: BoolArray, rng: np.random.Generator) -> TrainingCrop:
    height, width = image.shape[:2]
    first, last = (round(share * height / REDUCTION) for share in TRAINED_ROWS)
    top = int(rng.integers(first, last - CROP[0] // REDUCTION + 1)) * REDUCTION
    columns = (int(rng.integers(width)) + np.arange(CROP[1])) % width
    if rng.random() < 0.5:
        columns = columns[::-1]
    rows = np.arange(top, top + CROP[0])[:, None]
    return TrainingCrop(
        image[rows, columns], given[rows, columns], earlier[rows, columns], (top // REDUCTION, NETWORK_HEIGHT)
    )
