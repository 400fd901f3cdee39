"""Text lines by two networks of PP-OCRv4: detection (DB, Liao et al. 2020) and recognition (CTC, Graves 2006)."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import Float32Array, Float64Array, NumericArray, UInt8Array
from facade_core.imagery.detect.image_tiles import split_tiles
from facade_core.imagery.detect.models import LETTER_MODEL, LINE_MODEL, model_session
from facade_core.imagery.detect.settings import DETECTION

# The network takes sides that are multiples of this.
_SIDE_MULTIPLE = 32


@dataclass(frozen=True, slots=True, eq=False)
class TextLine:
    """Line of text.

    Attributes
    ----------
    corners : (4, 2) x, y in pixels, clockwise from the upper left.
    text : recognised text.
    score : mean probability of its characters.
    """

    corners: Float64Array
    text: str
    score: float

    @property
    def box(self) -> Float64Array:
        """Return x0, y0, x1, y1."""
        return np.concatenate([self.corners.min(axis=0), self.corners.max(axis=0)])

    @property
    def size(self) -> tuple[float, float]:
        """Return length and height."""
        return measure_line(self.corners)


def measure_line(corners: Float64Array) -> tuple[float, float]:
    """Return length and height of a line of text by its corners (4, 2)."""
    across, down = corners[1] - corners[0], corners[3] - corners[0]
    return float(np.hypot(*across)), float(np.hypot(*down))


def find_text_lines(
    image: UInt8Array, scale: float = 1.0, is_wanted: Callable[[Float64Array], bool] = lambda corners: True
) -> list[TextLine]:
    """Find and recognise the lines of text in an image.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    scale : enlargement.
    is_wanted : whether a line with these corners (4, 2) is to be recognised; the others are left out.
    """
    corners_found: list[Float64Array] = []
    for part, x, y in split_tiles(
        image, round(DETECTION.text_tile_side / scale), round(DETECTION.text_tile_overlap / scale)
    ):
        corners_found += [corners + np.array([x, y]) for corners in _lines_in_tile(_brighten(part), scale)]
    return [
        TextLine(corners_found[index], *_read_line(image, corners_found[index]))
        for index in _deduplicate(corners_found)
        if is_wanted(corners_found[index])
    ]


def merge_line_detections(lines: Sequence[TextLine], enlarged_lines: Sequence[TextLine]) -> list[TextLine]:
    """Merge the text lines of two detections on one image; of overlapping lines the larger one stays."""
    all_lines = [*lines, *enlarged_lines]
    return [all_lines[index] for index in _deduplicate([line.corners for line in all_lines])]


def _brighten(image: UInt8Array) -> UInt8Array:
    """Brighten an image (h, w, 3) uint8 if it is dark."""
    if np.median(image) >= DETECTION.dark_level:
        return image
    return np.rint(255 * (np.arange(256) / 255) ** DETECTION.brighten_gamma).astype(np.uint8)[image]


def _lines_in_tile(image: UInt8Array, scale: float) -> Iterator[Float64Array]:
    """Corners (4, 2) of the lines in a tile."""
    import cv2

    height, width = image.shape[:2]
    scale = max(scale, min(DETECTION.max_enlargement, DETECTION.min_input_side / min(height, width)))
    size = tuple(max(_SIDE_MULTIPLE, round(side * scale / _SIDE_MULTIPLE) * _SIDE_MULTIPLE) for side in (width, height))
    pixels = cv2.resize(image, size)[..., ::-1] / 255.0
    feed = ((pixels - 0.5) / 0.5).transpose(2, 0, 1)[None].astype(np.float32)
    net = model_session(LINE_MODEL)
    probability = net.run(None, {net.get_inputs()[0].name: feed})[0][0, 0]
    core = cv2.dilate((probability > DETECTION.min_pixel_probability).astype(np.uint8), np.ones((2, 2), np.uint8))
    for outline in cv2.findContours(core, cv2.RETR_LIST, cv2.CHAIN_APPROX_SIMPLE)[0]:
        middle, sides, angle = cv2.minAreaRect(outline)
        if (
            min(sides) < DETECTION.min_line_pixels
            or _mean_within(probability, cv2.boxPoints((middle, sides, angle))) < DETECTION.min_line_probability
        ):
            continue
        growth = DETECTION.unclip_ratio * math.prod(sides) / sum(sides)
        corners = cv2.boxPoints((middle, (sides[0] + growth, sides[1] + growth), angle))
        corners = corners * (np.array([width, height]) / size)
        yield _from_upper_left(np.clip(corners, 0, [width, height]))


def _mean_within(values: Float32Array, corners: NumericArray) -> float:
    import cv2

    x0, y0 = np.maximum(np.floor(corners.min(axis=0)).astype(int), 0)
    x1, y1 = np.ceil(corners.max(axis=0)).astype(int) + 1
    part = values[y0:y1, x0:x1]
    mask = np.zeros(part.shape, np.uint8)
    cv2.fillPoly(mask, [np.rint(corners - [x0, y0]).astype(np.int32)], 1)
    return float(part[mask > 0].mean()) if mask.any() else 0.0


def _from_upper_left(corners: Float64Array) -> Float64Array:
    """Corners of a rectangle, clockwise (y down) from the upper left one."""
    by_x = corners[np.argsort(corners[:, 0], kind="stable")]
    left, right = (side[np.argsort(side[:, 1], kind="stable")] for side in (by_x[:2], by_x[2:]))
    return np.stack([left[0], right[0], right[1], left[1]])


def _deduplicate(corners_found: Sequence[Float64Array]) -> list[int]:
    """Return the indices of the lines to keep, in reading order: the largest of overlapping lines."""
    kept: list[int] = []
    boxes = [np.concatenate([corners.min(axis=0), corners.max(axis=0)]) for corners in corners_found]
    areas = [float(np.prod(box[2:] - box[:2])) for box in boxes]
    for index in sorted(range(len(corners_found)), key=lambda i: -areas[i]):
        low = np.array([np.maximum(boxes[index][:2], boxes[other][:2]) for other in kept]).reshape(-1, 2)
        high = np.array([np.minimum(boxes[index][2:], boxes[other][2:]) for other in kept]).reshape(-1, 2)
        smaller = np.minimum(areas[index], [areas[other] for other in kept])
        if not (np.prod(np.maximum(high - low, 0), axis=1) > DETECTION.max_line_overlap * smaller).any():
            kept.append(index)
    return sorted(kept, key=lambda i: (boxes[i][1], boxes[i][0]))


def _read_line(image: UInt8Array, corners: Float64Array) -> tuple[str, float]:
    """Text of a line and mean probability of its characters; "" and 0 if nothing is recognised."""
    import cv2

    width, height = (
        max(1, round(float(max(np.hypot(*(corners[a] - corners[b])), np.hypot(*(corners[c] - corners[d]))))))
        for a, b, c, d in ((1, 0, 2, 3), (3, 0, 2, 1))
    )
    flat = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
    perspective = cv2.getPerspectiveTransform(corners.astype(np.float32), flat)
    line = cv2.warpPerspective(
        image, perspective, (width, height), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )
    if height >= DETECTION.upright_aspect * width:
        line = np.ascontiguousarray(np.rot90(line))
    wide = max(1, math.ceil(DETECTION.read_height * line.shape[1] / line.shape[0]))
    line = _brighten(np.asarray(cv2.resize(line, (wide, DETECTION.read_height)), np.uint8))
    feed = np.zeros((1, 3, DETECTION.read_height, max(DETECTION.min_read_width, wide)), np.float32)
    feed[0, :, :, :wide] = (line[..., ::-1] / 127.5 - 1).transpose(2, 0, 1)
    net = model_session(LETTER_MODEL)
    probabilities = net.run(None, {net.get_inputs()[0].name: feed})[0][0]
    best = probabilities.argmax(axis=1)
    columns = np.flatnonzero((best > 0) & (np.diff(best, prepend=0) != 0))
    if not len(columns):
        return "", 0.0
    letters = _alphabet()
    text = "".join(letters[best[column]] for column in columns)
    return text, float(probabilities[columns, best[columns]].mean())


@functools.cache
def _alphabet() -> tuple[str, ...]:
    """Characters of the outputs: the first is the CTC blank, the last a space."""
    characters = model_session(LETTER_MODEL).get_modelmeta().custom_metadata_map["character"]
    return ("", *characters.splitlines(), " ")
