"""Lines of text by two networks of PP-OCRv4: where they stand (DB, Liao et al. 2020), and what they say (CTC, Graves 2006)."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from facade_core.imagery.detect.image_tiles import split_tiles
from facade_core.imagery.detect.models import LETTER_MODEL, LINE_MODEL, session

# Tiles that are looked at: their side for the network, their overlap, and the least side that a small picture is brought
# to, enlarged so many times at most.
SIDE, OVERLAPPING, WORKED_AT, MOST = 960, 160, 736, 2.0
# A pixel is text from this probability on, a line where its mean is at least that; thinner ones in pixels are specks.
LEAST_PIXEL, LEAST_LINE, THINNEST = 0.3, 0.5, 3
# What is found is the core of a line: it grows by this times its area over its circumference.
GROWN = 1.6
# What is darker than this in the middle of its values is lit by this power: signs in the shade are missed otherwise. Chosen
# with ten of the photos of benchmarks/shop_signs.json in view.
_DARK, _LIT = 64, 0.5
# Of two lines that share more than this share of the smaller one's box the larger one stays.
SAME = 0.5
# A line is read at this height in pixels and at least this width; one as much higher than wide stands upright.
_READ_HEIGHT, _READ_WIDTH, _UPRIGHT = 48, 320, 1.5
_MULTIPLE = 32


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A line of text: corners (4, 2) x, y in pixels from its upper left on clockwise; what it says and how sure that is."""

    corners: np.ndarray
    text: str
    score: float

    @property
    def box(self) -> np.ndarray:
        """x0, y0, x1, y1."""
        return np.concatenate([self.corners.min(axis=0), self.corners.max(axis=0)])

    @property
    def size(self) -> tuple[float, float]:
        """Length and height."""
        across, down = self.corners[1] - self.corners[0], self.corners[3] - self.corners[0]
        return float(np.hypot(*across)), float(np.hypot(*down))


def find_lines(image: np.ndarray, scale: float = 1.0) -> list[Line]:
    """The lines of text in an image (H, W, 3) uint8, from its upper left on; found in the image enlarged so many times."""
    found: list[np.ndarray] = []
    for part, x, y in split_tiles(image, round(SIDE / scale), round(OVERLAPPING / scale)):
        found += [corners + np.array([x, y]) for corners in _in_tile(_lit(part), scale)]
    return [Line(found[index], *_read(image, found[index])) for index in _once(found)]


def joined(lines: Sequence[Line], closer: Sequence[Line]) -> list[Line]:
    """The lines of two looks at an image: of one that both found the larger, as the tiles of a closer look cut long ones."""
    every = [*lines, *closer]
    return [every[index] for index in _once([line.corners for line in every])]


def _lit(image: np.ndarray) -> np.ndarray:
    """A part of an image (h, w, 3) uint8, brighter where it is dark."""
    if np.median(image) >= _DARK:
        return image
    return np.rint(255 * (np.arange(256) / 255) ** _LIT).astype(np.uint8)[image]


def _in_tile(image: np.ndarray, scale: float) -> Iterator[np.ndarray]:
    """Corners (4, 2) of the lines in a part of an image."""
    import cv2

    height, width = image.shape[:2]
    scale = max(scale, min(MOST, WORKED_AT / min(height, width)))
    size = tuple(max(_MULTIPLE, round(side * scale / _MULTIPLE) * _MULTIPLE) for side in (width, height))
    pixels = cv2.resize(image, size)[..., ::-1] / 255.0
    feed = ((pixels - 0.5) / 0.5).transpose(2, 0, 1)[None].astype(np.float32)
    net = session(LINE_MODEL)
    chance = net.run(None, {net.get_inputs()[0].name: feed})[0][0, 0]
    core = cv2.dilate((chance > LEAST_PIXEL).astype(np.uint8), np.ones((2, 2), np.uint8))
    for outline in cv2.findContours(core, cv2.RETR_LIST, cv2.CHAIN_APPROX_SIMPLE)[0]:
        middle, sides, angle = cv2.minAreaRect(outline)
        if min(sides) < THINNEST or _mean_within(chance, cv2.boxPoints((middle, sides, angle))) < LEAST_LINE:
            continue
        more = GROWN * math.prod(sides) / sum(sides)
        corners = cv2.boxPoints((middle, (sides[0] + more, sides[1] + more), angle))
        corners = corners * (np.array([width, height]) / size)
        yield _from_upper_left(np.clip(corners, 0, [width, height]))


def _mean_within(values: np.ndarray, corners: np.ndarray) -> float:
    import cv2

    x0, y0 = np.maximum(np.floor(corners.min(axis=0)).astype(int), 0)
    x1, y1 = np.ceil(corners.max(axis=0)).astype(int) + 1
    part = values[y0:y1, x0:x1]
    mask = np.zeros(part.shape, np.uint8)
    cv2.fillPoly(mask, [np.rint(corners - [x0, y0]).astype(np.int32)], 1)
    return float(part[mask > 0].mean()) if mask.any() else 0.0


def _from_upper_left(corners: np.ndarray) -> np.ndarray:
    """The corners of a rectangle clockwise (y down) from the upper left one."""
    by_x = corners[np.argsort(corners[:, 0], kind="stable")]
    left, right = (side[np.argsort(side[:, 1], kind="stable")] for side in (by_x[:2], by_x[2:]))
    return np.stack([left[0], right[0], right[1], left[1]])


def _once(found: Sequence[np.ndarray]) -> list[int]:
    """Which lines, by their corners (4, 2), to keep: of those that are the same, whole or in part, the largest; in their order
    on the image."""
    kept: list[int] = []
    boxes = [np.concatenate([c.min(axis=0), c.max(axis=0)]) for c in found]
    areas = [float(np.prod(box[2:] - box[:2])) for box in boxes]
    for index in sorted(range(len(found)), key=lambda i: -areas[i]):
        low = np.array([np.maximum(boxes[index][:2], boxes[other][:2]) for other in kept]).reshape(-1, 2)
        high = np.array([np.minimum(boxes[index][2:], boxes[other][2:]) for other in kept]).reshape(-1, 2)
        least = np.minimum(areas[index], [areas[other] for other in kept])
        if not (np.prod(np.maximum(high - low, 0), axis=1) > SAME * least).any():
            kept.append(index)
    return sorted(kept, key=lambda i: (boxes[i][1], boxes[i][0]))


def _read(image: np.ndarray, corners: np.ndarray) -> tuple[str, float]:
    """What a line says, and the mean probability of its letters; "" and 0 where nothing is read."""
    import cv2

    width, height = (
        max(1, round(float(max(np.hypot(*(corners[a] - corners[b])), np.hypot(*(corners[c] - corners[d]))))))
        for a, b, c, d in ((1, 0, 2, 3), (3, 0, 2, 1))
    )
    flat = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
    turned = cv2.getPerspectiveTransform(corners.astype(np.float32), flat)
    line = cv2.warpPerspective(image, turned, (width, height), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    if height >= _UPRIGHT * width:
        line = np.ascontiguousarray(np.rot90(line))
    wide = max(1, math.ceil(_READ_HEIGHT * line.shape[1] / line.shape[0]))
    line = _lit(cv2.resize(line, (wide, _READ_HEIGHT)))
    feed = np.zeros((1, 3, _READ_HEIGHT, max(_READ_WIDTH, wide)), np.float32)
    feed[0, :, :, :wide] = (line[..., ::-1] / 127.5 - 1).transpose(2, 0, 1)
    net = session(LETTER_MODEL)
    chances = net.run(None, {net.get_inputs()[0].name: feed})[0][0]
    best = chances.argmax(axis=1)
    told = np.flatnonzero((best > 0) & (np.diff(best, prepend=0) != 0))
    if not len(told):
        return "", 0.0
    letters = _letters()
    text = "".join(letters[best[at]] for at in told)
    return text, float(chances[told, best[told]].mean())


@functools.cache
def _letters() -> tuple[str, ...]:
    """What the outputs stand for; the first is for nothing, the last for a blank."""
    told = session(LETTER_MODEL).get_modelmeta().custom_metadata_map["character"]
    return ("", *told.splitlines(), " ")
