"""Parsing of a rectified facade: forest votes on a grid, averaged in superpixels (tiles paper, sections 3.1, 4.1)."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from scipy import ndimage

from facade_core.errors import ImageError
from facade_core.labels import CLASSES
from facade_core.parse import features
from facade_core.parse.checks import check_image
from facade_core.parse.forest import FIRST, SECOND, Forests, load
from facade_core.types import Parsing

# Before anything else the image is scaled to an area within these bounds, if that takes no more than _MOST_GROWTH and
# keeps both sides short. The lower one is about the size of the facades trained on: parsed at a quarter of their size
# as they are, the held-out ones keep 68 % of their pixels right; enlarged first, 85 %.
_WORKING_AREA = (150_000, 250_000)
_MOST_GROWTH = 4.0
_WORKING_SIDE = 2048
# Some 1000 to 2000 segments in a facade of usual size. Compact ones: loose ones cut corners off windows.
_SEGMENT_AREA = 100
_COMPACTNESS = 20
_SLIC_ROUNDS = 5
# Rows of the full image written at once, so that memory beyond the result is bounded.
_BAND = 128


def parse(image: np.ndarray, *, model: str | Path | None = None) -> Parsing:
    """Label each pixel of a rectified facade with one of the seven classes.

    image: (H, W, 3) uint8 RGB, or (H, W, 4) RGBA where alpha < 128 hides a pixel. model: another .onnx file with its
    .json beside it. A first forest votes from appearance, a second one from appearance and the first one's votes
    around; the second one's votes are smoothed by their averages in superpixels and the class of most votes wins.

    confidence sums to 1 in each pixel. occluded marks hidden pixels; they take the confidence, and so the label, of
    the nearest visible place, and their colours are not looked at. Without an alpha channel nothing is occluded.
    Time and memory are bounded whatever the image's size, but for the returned arrays themselves.

    Raises ImageError for an image of another kind or without a visible pixel, ModelError for an unusable model.
    """
    check_image(image)
    forests = load(model)
    height, width = image.shape[:2]
    occluded = image[..., 3] < 128 if image.shape[2] == 4 else np.zeros((height, width), bool)
    if occluded.all():
        raise ImageError("image: alpha hides every pixel; pass the image without its alpha channel, or a visible one")
    working, nearest = _to_working_size(image[..., :3], occluded)
    confidence = _confidence(working, forests)
    if nearest is not None:
        confidence = confidence[nearest]
    labels, confidence = _to_full_size(confidence, height, width)
    return Parsing(labels, confidence, occluded)


def _to_working_size(
    image: np.ndarray, occluded: np.ndarray
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray] | None]:
    """The image at working size, hidden places filled from the nearest visible ones, and where each is filled from."""
    import cv2

    height, width = occluded.shape
    area = height * width
    scale = math.sqrt(min(max(area, _WORKING_AREA[0]), _WORKING_AREA[1]) / area)
    scale = min(scale, _MOST_GROWTH, _WORKING_SIDE / max(height, width))
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    mode = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    working = cv2.resize(np.ascontiguousarray(image), size, interpolation=mode)
    if not occluded.any():
        return working, None
    hidden = cv2.resize(occluded.astype(np.float32), size, interpolation=mode)
    # A working pixel that hidden ones have a share in has their colour mixed in: only the purest count as visible.
    rows, columns = ndimage.distance_transform_edt(hidden > hidden.min(), return_distances=False, return_indices=True)
    return working[rows, columns], (rows, columns)


def _confidence(image: np.ndarray, forests: Forests) -> np.ndarray:
    """Votes at working size: (H, W, 3) uint8 -> (H, W, 7) float32."""
    seen = features.appearance(image)
    first = forests.vote(FIRST, seen)
    second = forests.vote(SECOND, features.context(first, seen))
    return _average_in_segments(image, _cells_to_pixels(second, *image.shape[:2]))


def _cells_to_pixels(votes: np.ndarray, height: int, width: int) -> np.ndarray:
    import cv2

    size = (votes.shape[1] * features.CELL, votes.shape[0] * features.CELL)
    return cv2.resize(votes, size, interpolation=cv2.INTER_LINEAR)[:height, :width]


def _average_in_segments(image: np.ndarray, votes: np.ndarray) -> np.ndarray:
    """Each pixel's own votes and its segment's mean, in equal parts.

    The segment's mean alone, as in the paper, loses 1.5 % of the ECP pixels at this segment size and 6.5 % at 180
    pixels a segment with loose segments: railings that one sees a window through tear the segments.
    """
    from skimage.segmentation import slic

    count = max(1, round(image.shape[0] * image.shape[1] / _SEGMENT_AREA))
    segments = slic(image, n_segments=count, compactness=_COMPACTNESS, max_num_iter=_SLIC_ROUNDS, start_label=0)
    segments = segments.reshape(-1)
    flat = votes.reshape(-1, len(CLASSES))
    sums = np.stack([np.bincount(segments, column) for column in flat.T], axis=1)
    means = sums / sums.sum(1, keepdims=True)
    return ((flat + means[segments]) / 2).reshape(votes.shape).astype(np.float32)


def _to_full_size(confidence: np.ndarray, height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Labels and confidence at full size, confidence interpolated linearly, in bands of rows."""
    labels = np.empty((height, width), np.uint8)
    if confidence.shape[:2] == (height, width):
        full = confidence
    else:
        full = np.empty((height, width, len(CLASSES)), np.float32)
        top, bottom, down = _neighbours(height, confidence.shape[0])
        left, right, across = _neighbours(width, confidence.shape[1])
    for start in range(0, height, _BAND):
        band = slice(start, start + _BAND)
        if full is not confidence:
            share = down[band, None, None]
            rows = confidence[top[band]] * (1 - share) + confidence[bottom[band]] * share
            full[band] = rows[:, left] * (1 - across[:, None]) + rows[:, right] * across[:, None]
        labels[band] = full[band].argmax(2)
    return labels, full


def _neighbours(length: int, source: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """For each pixel centre the two source pixels beside it and the share of the second."""
    position = np.clip((np.arange(length) + 0.5) * source / length - 0.5, 0, source - 1)
    first = np.floor(position).astype(np.intp)
    return first, np.minimum(first + 1, source - 1), (position - first).astype(np.float32)
