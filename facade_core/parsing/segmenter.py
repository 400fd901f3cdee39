"""Parsing of a rectified facade: scaling to the segmenter's working size, and back."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
from scipy import ndimage

from facade_core.core.arrays import BoolArray, Float32Array, Int32Array, Int64Array, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.labels import CLASSES, FacadeClass
from facade_core.core.types import Box, Parsing, TrainedModelFiles
from facade_core.parsing.network import SHIPPED_NETWORK, load_network
from facade_core.parsing.regularity import draw_windows_into_labels, extract_regular_window_boxes
from facade_core.parsing.segmentation import Segmentation
from facade_core.parsing.semantic_network import OccluderSegmenter, load_semantic_network
from facade_core.parsing.validation import check_image

# Model used by default.
DEFAULT_MODEL = SHIPPED_NETWORK

# Images are scaled to an area that the segmenter is used to, enlarged by at most this factor,
_MAX_ENLARGEMENT = 4.0
# with sides of at most this many pixels: time and memory do not grow with the image.
_MAX_WORKING_SIDE = 2048
# Occluders are parts above the first probability that reach the second somewhere. On the Swiss test photos this
# is as good as the first alone, and it rejects ornament that resembles leaves.
_OCCLUDER_THRESHOLDS = (0.5, 0.8)
# Parts that reach into this lowest share of the rows
_FOOT_SHARE = 0.1
# extend over connected pixels of at least this probability,
_STANDING_THRESHOLD = 0.3
# up to this share of the picture's side: the network doubts heads, legs and plain sides of vans. Chosen on 28
# training photos with pasted objects.
_MAX_STANDING_REACH = 0.04
# Probability from which a pixel is outside the facade.
_OUTSIDE_THRESHOLD = 0.5
# Windows are drawn at the image's own size, unless that is below this share of the working size.
_MIN_DRAWING_SCALE = 0.5
# Rows of the full image written at once, which bounds memory beyond the result.
_BAND_ROWS = 128


# Area of a crop of a segmentation, in pixels: that at which the regularity of windows is tuned.
_CROP_AREA = (150_000, 250_000)

# File of a parser, or the models of a block; None selects the shipped parser.
ParserModel = str | Path | TrainedModelFiles | None

# Rows and columns.
_Places = tuple[Int32Array, Int32Array]


class Segmenter(Protocol):
    """Model that segments an image at working size."""

    @property
    def working_area(self) -> tuple[int, int]:
        """Return the smallest and largest number of pixels of an image."""

    def segment(self, image: UInt8Array) -> Segmentation:
        """Segment an image (H, W, 3) uint8 RGB."""


def load_segmenter(model: ParserModel = None) -> Segmenter:
    """Load the parser, the shipped one by default, with the semantic network of a block that names one.

    Raises
    ------
    ModelError
        If the model cannot be used.
    """
    files = model if isinstance(model, TrainedModelFiles) else TrainedModelFiles(None if model is None else Path(model))
    parser = load_network(files.parser or DEFAULT_MODEL)
    if files.segmentation is None:
        return parser
    return OccluderSegmenter(parser, load_semantic_network(files.segmentation))


def parse(image: UInt8Array, *, model: ParserModel = None) -> Parsing:
    """Label each pixel of a rectified facade with one of the seven classes.

    Windows are made rectangular and aligned (`regularity`); then the class of highest confidence wins. The confidence
    sums to 1 per pixel. Occluded pixels are hidden by alpha, or show a tree, a car or the like in front
    of the facade. Pixels that alpha hides take the confidence of the nearest visible place, except windows, which are
    drawn whole; their colours are ignored. Behind a tree the label is the segmenter's guess. Time and memory are
    bounded for images of any size, except for the returned arrays and a few maps of one byte per pixel.

    Parameters
    ----------
    image : (H, W, 3) uint8 RGB, or (H, W, 4) RGBA where alpha < 128 hides a pixel.
    model : another .onnx file with its .json, or the models of a block.

    Raises
    ------
    ImageError
        If the image is of another kind or has no visible pixel.
    ModelError
        If the model cannot be used.
    """
    check_image(image)
    return parse_with_segmenter(image, load_segmenter(model))


def parse_with_segmenter(image: UInt8Array, segmenter: Segmenter, *, regularise: bool = True) -> Parsing:
    """Parse an image by a given segmenter, see `parse`.

    Parameters
    ----------
    image : (H, W, 3) or (H, W, 4) uint8.
    segmenter : model to use.
    regularise : False keeps the windows of the segmenter, to measure the effect of regularity.
    """
    check_image(image)
    hidden = _hidden_by_alpha(image)
    working, nearest = _to_working_size(image[..., :3], hidden, segmenter.working_area)
    return _parse(segmenter.segment(working), hidden, nearest, regularise)


def parse_segmentation(segmentation: Segmentation, hidden: BoolArray) -> Parsing:
    """Parse a picture that is segmented already, as `parse` does.

    Parameters
    ----------
    segmentation : segmentation of the picture at any size.
    hidden : (H, W) bool, not all pixels.
    """
    return _parse(segmentation, hidden, _nearest_visible(hidden, segmentation.occluder.shape), True)


def _parse(segmentation: Segmentation, hidden: BoolArray, nearest: _Places | None, regularise: bool) -> Parsing:
    """Parse a segmented picture; `nearest`: where hidden places take their confidence from."""
    (height, width), (confidence, occluder, _) = hidden.shape, segmentation
    windows = extract_regular_window_boxes(confidence) if regularise else np.zeros((0, 4), np.intp)
    scale = np.array([width / confidence.shape[1], height / confidence.shape[0]])
    if coarse := scale.min() < _MIN_DRAWING_SCALE:
        confidence = confidence.copy()
        draw_windows_into_labels(confidence.argmax(2).astype(np.uint8), confidence, windows)
    if nearest is not None:
        confidence, occluder = confidence[nearest], occluder[nearest]
    labels, confidence = _to_full_size(confidence, height, width)
    if not coarse:  # enlarged with the rest, windows would have round corners
        draw_windows_into_labels(labels, confidence, np.rint(windows * np.tile(scale, 2)).astype(np.intp))
    return Parsing(labels, confidence, hidden | _enlarge(_occluder_regions(occluder), height, width))


def occluder_mask(segmentation: Segmentation, shape: tuple[int, int]) -> BoolArray:
    """Mask (H, W) the trees, cars and the like of a segmented picture of a shape."""
    return _enlarge(_occluder_regions(segmentation.occluder), *shape)


def _occluder_regions(probability: Float32Array) -> BoolArray:
    """Occluder mask (H, W) bool from the probability at each pixel."""
    from skimage.filters import apply_hysteresis_threshold
    from skimage.measure import label

    is_occluder = apply_hysteresis_threshold(probability, *_OCCLUDER_THRESHOLDS)
    parts = label(is_occluder)
    foot = parts[-max(1, round(_FOOT_SHARE * len(parts))) :]
    standing = np.isin(parts, foot[foot > 0])
    reach = max(1, round(_MAX_STANDING_REACH * math.sqrt(probability.size)))
    square = np.ones((3, 3), bool)
    regions: BoolArray = is_occluder | ndimage.binary_dilation(
        standing, square, reach, mask=standing | (probability > _STANDING_THRESHOLD)
    )
    return regions


class Surroundings(NamedTuple):
    """What a picture shows of a facade and beside it.

    Attributes
    ----------
    outside : (H, W) bool, sky, street or neighbours.
    labels : (H, W) uint8 classes.
    """

    outside: BoolArray
    labels: UInt8Array


def facade_surroundings_mask(image: UInt8Array, hidden: BoolArray, *, model: ParserModel = None) -> BoolArray:
    """Mask sky, street and neighbours outside a facade; parameters as in `segment_surroundings`."""
    return segment_surroundings(image, hidden, model=model).outside


def segment_surroundings(image: UInt8Array, hidden: BoolArray, *, model: ParserModel = None) -> Surroundings:
    """Segment a picture into facade and surroundings; parameters as in `segment_picture`."""
    return classify_surroundings(segment_picture(image, hidden, model=model), hidden)


def segment_picture(image: UInt8Array, hidden: BoolArray, *, model: ParserModel = None) -> Segmentation:
    """Segment a picture at the working size of the segmenter.

    Parameters
    ----------
    image : (H, W, 3) uint8 RGB.
    hidden : (H, W) bool, not all pixels; hidden pixels are filled from the nearest visible one.
    model : as in `parse`, with its time and errors.
    """
    check_image(image)
    segmenter = load_segmenter(model)
    return segmenter.segment(_to_working_size(image, hidden, segmenter.working_area)[0])


def classify_surroundings(segmentation: Segmentation, hidden: BoolArray) -> Surroundings:
    """Classify the pixels of a segmented picture as facade and surroundings.

    Parameters
    ----------
    segmentation : segmentation of the picture at any size.
    hidden : (H, W) bool, not all pixels; hidden pixels take the result of the nearest visible one.
    """
    labels = segmentation.confidence.argmax(2).astype(np.uint8)
    outside = (segmentation.outside >= _OUTSIDE_THRESHOLD) | (labels == FacadeClass.SKY)
    nearest = _nearest_visible(hidden, labels.shape)
    if nearest is not None:
        outside, labels = outside[nearest], labels[nearest]
    return Surroundings(_enlarge(outside, *hidden.shape), _enlarge_labels(labels, *hidden.shape))


def crop_segmentation(segmentation: Segmentation, box: Box, size: tuple[int, int]) -> Segmentation:
    """Crop the segmentation of a picture to a box, at the working size of what is in it: interpolated linearly.

    Parameters
    ----------
    segmentation : segmentation of the whole picture at any size.
    box : x0, y0, x1, y1 in pixels of the picture, half-open.
    size : height and width of the picture.
    """
    import cv2

    x0, y0, x1, y1 = box
    rows, columns = _working_size((y1 - y0, x1 - x0), _CROP_AREA)
    down, across = (own / whole for own, whole in zip(segmentation.occluder.shape, size, strict=True))
    x = (x0 + (np.arange(columns) + 0.5) * (x1 - x0) / columns) * across - 0.5
    y = (y0 + (np.arange(rows) + 0.5) * (y1 - y0) / rows) * down - 0.5
    x_map, y_map = np.meshgrid(x.astype(np.float32), y.astype(np.float32))
    parts = (cv2.remap(one, x_map, y_map, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) for one in segmentation)
    return Segmentation(*(np.asarray(part, np.float32) for part in parts))


def _hidden_by_alpha(image: UInt8Array) -> BoolArray:
    hidden = image[..., 3] < 128 if image.shape[2] == 4 else np.zeros(image.shape[:2], bool)
    if hidden.all():
        raise ImageError("image: alpha hides every pixel; pass the image without its alpha channel, or a visible one")
    return hidden


def _to_working_size(
    image: UInt8Array, hidden: BoolArray, area_bounds: tuple[int, int]
) -> tuple[UInt8Array, _Places | None]:
    """Image at working size with hidden places filled from the nearest visible ones, and the source of each."""
    import cv2

    size = _working_size(hidden.shape, area_bounds)
    working = np.asarray(
        cv2.resize(np.ascontiguousarray(image), size[::-1], interpolation=_scaling_mode(hidden.shape, size)), np.uint8
    )
    nearest = _nearest_visible(hidden, size)
    return (working if nearest is None else working[nearest]), nearest


def _working_size(shape: tuple[int, ...], area_bounds: tuple[int, int]) -> tuple[int, int]:
    """Height and width of a picture (h, w) at working size."""
    height, width = shape
    area = height * width
    scale = math.sqrt(min(max(area, area_bounds[0]), area_bounds[1]) / area)
    scale = min(scale, _MAX_ENLARGEMENT, _MAX_WORKING_SIDE / max(height, width))
    return max(1, round(height * scale)), max(1, round(width * scale))


def _scaling_mode(shape: tuple[int, ...], size: tuple[int, ...]) -> int:
    import cv2

    return cv2.INTER_AREA if size[0] * size[1] < shape[0] * shape[1] else cv2.INTER_LINEAR


def _nearest_visible(hidden: BoolArray, size: tuple[int, ...]) -> _Places | None:
    """Rows and columns, at a size, of the visible place nearest to each one; None where nothing is hidden."""
    import cv2

    if not hidden.any():
        return None
    share = cv2.resize(hidden.astype(np.float32), size[::-1], interpolation=_scaling_mode(hidden.shape, size))
    # Working pixels with a share of hidden ones contain their colour: only the purest count as visible.
    rows, columns = ndimage.distance_transform_edt(share > share.min(), return_distances=False, return_indices=True)
    return rows, columns


def _to_full_size(confidence: Float32Array, height: int, width: int) -> tuple[UInt8Array, Float32Array]:
    """Labels and confidence at full size, interpolated linearly in bands of rows."""
    labels = np.empty((height, width), np.uint8)
    if confidence.shape[:2] == (height, width):
        full = confidence
    else:
        full = np.empty((height, width, len(CLASSES)), np.float32)
        top, bottom, down = _interpolation_neighbours(height, confidence.shape[0])
        left, right, across = _interpolation_neighbours(width, confidence.shape[1])
    for start in range(0, height, _BAND_ROWS):
        band = slice(start, start + _BAND_ROWS)
        if full is not confidence:
            share = down[band, None, None]
            rows = confidence[top[band]] * (1 - share) + confidence[bottom[band]] * share
            full[band] = rows[:, left] * (1 - across[:, None]) + rows[:, right] * across[:, None]
        labels[band] = full[band].argmax(2)
    return labels, full


def _enlarge(mask: BoolArray, height: int, width: int) -> BoolArray:
    enlarged: BoolArray = _enlarge_labels(mask.astype(np.uint8), height, width) == 1
    return enlarged


def _enlarge_labels(labels: UInt8Array, height: int, width: int) -> UInt8Array:
    import cv2

    return np.asarray(cv2.resize(labels, (width, height), interpolation=cv2.INTER_NEAREST), np.uint8)


def _interpolation_neighbours(length: int, source: int) -> tuple[Int64Array, Int64Array, Float32Array]:
    """Both source pixels next to each pixel centre, and the share of the second."""
    position = np.clip((np.arange(length) + 0.5) * source / length - 0.5, 0, source - 1)
    first = np.floor(position).astype(np.intp)
    return first, np.minimum(first + 1, source - 1), (position - first).astype(np.float32)
