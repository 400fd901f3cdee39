"""Parsing of a rectified facade by a segmenter: to the size it works at, and back."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Protocol

import numpy as np
from scipy import ndimage

from facade_core.core.errors import ImageError
from facade_core.core.labels import CLASSES, FacadeClass
from facade_core.core.model_file import file_stamps
from facade_core.core.types import Parsing
from facade_core.parsing import network
from facade_core.parsing.regularity import draw_windows, window_boxes
from facade_core.parsing.segmentation import Segmentation
from facade_core.parsing.validation import check_image

# The model that parses where none is named.
DEFAULT_MODEL = network.SHIPPED_NETWORK

# Before anything else the image is scaled to an area that the segmenter is used to, if that takes no more than
# _MOST_GROWTH and keeps both sides short; so time and memory do not grow with the image.
_MOST_GROWTH = 4.0
_WORKING_SIDE = 2048
# Something is in front where its probability is above the first, in a part that somewhere reaches the second: on the Swiss
# test photos as good as the first alone, and ornament that is only half taken for leaves is let go.
_IN_FRONT = (0.5, 0.8)
# To such a part that reaches into this share of the rows, the lowest, belongs what is joined to it, at least so likely and no
# farther than this share of the picture's side: heads, legs and plain sides of vans, which the network doubts. Chosen on 28 of
# the photos that it was trained on, with things pasted in front.
_FOOT, _OF_WHAT_STANDS, _REACH = 0.1, 0.3, 0.04
# What is likelier beside the facade than on it is outside.
_OUTSIDE = 0.5
# Windows are drawn at the image's own size; below this share of the working size its pixels are too coarse for them.
_COARSE = 0.5
# Rows of the full image written at once, so that memory beyond the result is bounded.
_BAND = 128


class Segmenter(Protocol):
    """Parser of an image at working size."""

    @property
    def working_area(self) -> tuple[int, int]:
        """Least and most pixels of an image that it is meant for."""

    def segment(self, image: np.ndarray) -> Segmentation:
        """Of an image (H, W, 3) uint8 RGB."""


def load_segmenter(model: str | Path | None = None) -> Segmenter:
    """The segmenter of an .onnx file with its .json beside it; the shipped one without a model. Raises ModelError."""
    path = DEFAULT_MODEL if model is None else Path(model)
    file_stamps(path)
    return network.load(path)


def parse(image: np.ndarray, *, model: str | Path | None = None) -> Parsing:
    """Label each pixel of a rectified facade with one of the seven classes.

    image: (H, W, 3) uint8 RGB, or (H, W, 4) RGBA where alpha < 128 hides a pixel. model: another .onnx file with its
    .json beside it. Windows and balconies are made rectangular and aligned
    (`regularity`); then the class of most confidence wins.

    confidence sums to 1 in each pixel. occluded marks pixels that alpha hides or where the segmenter sees a tree, a
    car or the like in front of the facade. What alpha hides takes the confidence, and so the label, of the nearest
    visible place, but for windows, which are drawn whole, and its colours are not looked at; behind a tree the label is the
    segmenter's guess. Time and memory are bounded whatever the image's size, but for the returned arrays and a few maps of a
    byte a pixel.

    Raises ImageError for an image of another kind or without a visible pixel, ModelError for an unusable model.
    """
    check_image(image)
    return parse_with_segmenter(image, load_segmenter(model))


def parse_with_segmenter(image: np.ndarray, segmenter: Segmenter, *, regularise: bool = True) -> Parsing:
    """`parse` by a segmenter; not `regular`: windows as the segmenter sees them, to measure what regularity brings."""
    check_image(image)
    height, width = image.shape[:2]
    occluded = _hidden_by_alpha(image)
    working, nearest = _to_working_size(image[..., :3], occluded, segmenter.working_area)
    confidence, hidden, _ = segmenter.segment(working)
    windows = window_boxes(confidence) if regularise else np.zeros((0, 4), np.intp)
    scale = np.array([width / confidence.shape[1], height / confidence.shape[0]])
    if coarse := scale.min() < _COARSE:
        draw_windows(confidence.argmax(2).astype(np.uint8), confidence, windows)
    if nearest is not None:
        confidence, hidden = confidence[nearest], hidden[nearest]
    labels, confidence = _to_full_size(confidence, height, width)
    if not coarse:  # at its own size: enlarged with the rest, windows would be round at their corners
        draw_windows(labels, confidence, np.rint(windows * np.tile(scale, 2)).astype(np.intp))
    return Parsing(labels, confidence, occluded | _enlarge(_occluder_regions(hidden), height, width))


def _occluder_regions(hidden: np.ndarray) -> np.ndarray:
    """Where something is in front, (H, W) bool, by how likely that is at each pixel."""
    from skimage.filters import apply_hysteresis_threshold
    from skimage.measure import label

    sure = apply_hysteresis_threshold(hidden, *_IN_FRONT)
    parts = label(sure)
    foot = parts[-max(1, round(_FOOT * len(parts))) :]
    standing = np.isin(parts, foot[foot > 0])
    reach = max(1, round(_REACH * math.sqrt(hidden.size)))
    square = np.ones((3, 3), bool)
    return sure | ndimage.binary_dilation(standing, square, reach, mask=standing | (hidden > _OF_WHAT_STANDS))


def outside_mask(image: np.ndarray, hidden: np.ndarray, *, model: str | Path | None = None) -> np.ndarray:
    """Where a picture of a facade, (H, W, 3) uint8 RGB, shows sky, street or neighbours beside it, (H, W) bool; what is hidden
    (H, W) bool, which is not all of it, is told by what is seen nearest to it. model, time and errors as of `parse`.
    """
    check_image(image)
    segmenter = load_segmenter(model)
    working, nearest = _to_working_size(image, hidden, segmenter.working_area)
    seen = segmenter.segment(working)
    outside = (seen.outside >= _OUTSIDE) | (seen.confidence.argmax(2) == FacadeClass.SKY)
    return _enlarge(outside if nearest is None else outside[nearest], *hidden.shape)


def _hidden_by_alpha(image: np.ndarray) -> np.ndarray:
    hidden = image[..., 3] < 128 if image.shape[2] == 4 else np.zeros(image.shape[:2], bool)
    if hidden.all():
        raise ImageError("image: alpha hides every pixel; pass the image without its alpha channel, or a visible one")
    return hidden


def _to_working_size(
    image: np.ndarray, occluded: np.ndarray, area_bounds: tuple[int, int]
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray] | None]:
    """The image at working size, hidden places filled from the nearest visible ones, and where each is filled from."""
    import cv2

    height, width = occluded.shape
    area = height * width
    scale = math.sqrt(min(max(area, area_bounds[0]), area_bounds[1]) / area)
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


def _enlarge(mask: np.ndarray, height: int, width: int) -> np.ndarray:
    import cv2

    return cv2.resize(mask.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST) == 1


def _neighbours(length: int, source: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """For each pixel centre the two source pixels beside it and the share of the second."""
    position = np.clip((np.arange(length) + 0.5) * source / length - 0.5, 0, source - 1)
    first = np.floor(position).astype(np.intp)
    return first, np.minimum(first + 1, source - 1), (position - first).astype(np.float32)
