"""Faces and number plates on a picture, and its text: a second opinion beside the parser's, where the models are there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from facade_core.core.types import Box
from facade_core.imagery.detect.faces import SMALL, find_faces
from facade_core.imagery.detect.models import models_digest
from facade_core.imagery.detect.plates import is_plate
from facade_core.imagery.detect.text import Line, find_lines, joined

# What is hidden is larger than what is found by this share of its longer side, to every side: hair and chin, a plate's rim.
RIM = 0.4
# A panorama is looked at so many pixels on across its border: no face or plate there is wider.
SEAM = 256
# Plates stand in the lower part of a picture, below this share of its height.
LOW = 0.5
# Between these shares of a full panorama's height, 27 degrees over the horizon and 63 below it, faces and plates are looked
# for; the latter stand below the horizon.
UPPERMOST, HORIZON, LOWERMOST = 0.35, 0.5, 0.85
# Of a picture of ordinary size they are looked for so many times enlarged: of 24 marked by eye four were found at twice, eight
# at three times their size, and of those left few can be read.
CLOSER = 3.0


def _none() -> np.ndarray:
    return np.zeros((0, 4))


@dataclass(frozen=True, slots=True, eq=False)
class Detections:
    """faces, plates (n, 4): boxes x0, y0, x1, y1 in pixels; lines of text, the plates' among them."""

    faces: np.ndarray = field(default_factory=_none)
    plates: np.ndarray = field(default_factory=_none)
    lines: Sequence[Line] = ()

    def has_private_boxes(self) -> bool:
        """Whether there is anything to hide."""
        return len(self.faces) + len(self.plates) > 0

    def rescale(self, across: float, down: float) -> Detections:
        """The same on the picture at another size."""
        both = np.array([across, down])
        lines = [replace(line, corners=line.corners * both) for line in self.lines]
        return Detections(self.faces * np.tile(both, 2), self.plates * np.tile(both, 2), lines)

    def translate(self, across: float, down: float) -> Detections:
        """The same on a picture of which this one is a part that begins there."""
        both = np.array([across, down])
        lines = [replace(line, corners=line.corners + both) for line in self.lines]
        return Detections(self.faces + np.tile(both, 2), self.plates + np.tile(both, 2), lines)

    def private_boxes(self, shape: tuple[int, int]) -> tuple[Box, ...]:
        """What is to be hidden of a picture (H, W): boxes of whole pixels, faces first."""
        found = []
        for x0, y0, x1, y1 in np.concatenate([self.faces, self.plates]).tolist():
            rim = RIM * max(x1 - x0, y1 - y0)
            left, top = max(0, int(x0 - rim)), max(0, int(y0 - rim))
            right, bottom = min(shape[1], int(x1 + rim) + 1), min(shape[0], int(y1 + rim) + 1)
            found.append((left, top, right, bottom))
        return tuple(found)

    def private_mask(self, shape: tuple[int, int]) -> np.ndarray:
        """The same as a mask (H, W) bool."""
        mask = np.zeros(shape, bool)
        for x0, y0, x1, y1 in self.private_boxes(shape):
            mask[y0:y1, x0:x1] = True
        return mask


def detectors_available() -> bool:
    """Whether faces, plates and text are looked for here: where the packages that bring the models are installed."""
    return bool(models_digest())


def detect_on_image(image: np.ndarray, plates_top: float = LOW) -> Detections:
    """What there is on a picture (H, W, 3) uint8; plates below the share `low` of its height. Nothing without the models."""
    if not detectors_available():
        return Detections()
    plates, lines = find_plates(image, plates_top)
    return Detections(find_faces(image)[0], plates, lines)


def detect_on_strip(image: np.ndarray, plates_top: float = LOW) -> Detections:
    """The same on a strip (H, W, 3) of a whole panorama, whose left border goes on from its right one: what lies across is
    found whole, and is there at both."""
    width = image.shape[1]
    seen = detect_on_image(np.concatenate([image, image[:, :SEAM]], axis=1), plates_top)
    lines = [line for line in seen.lines if line.box[0] < width]
    return Detections(_around(seen.faces, width), _around(seen.plates, width), lines)


def detect_on_panorama(image: np.ndarray, view: tuple[float, float, float, float]) -> Detections:
    """The same on the part `view` of a panorama, as of `facade_core.core.types.Pose`: between UPPERMOST and LOWERMOST."""
    _, top, wide, share = view
    first, middle, last = (
        min(len(image), max(0, round((row - top) / share * len(image)))) for row in (UPPERMOST, HORIZON, LOWERMOST)
    )
    if last == first:
        return Detections()
    looked = detect_on_strip if wide == 1 else detect_on_image
    return looked(image[first:last], (middle - first) / (last - first)).translate(0, first)


def _around(boxes: np.ndarray, width: int) -> np.ndarray:
    """Boxes (n, 4) of a strip that goes on beyond its width, as on the strip: one across the border in two parts."""
    own = boxes[boxes[:, 0] < width]
    return np.concatenate([own, own[own[:, 2] > width] - np.array([width, 0, width, 0])])


def find_plates(image: np.ndarray, plates_top: float = LOW) -> tuple[np.ndarray, list[Line]]:
    """Boxes (n, 4) of the number plates below the share `low` of an image's height, and all its lines of text.

    Of a picture of ordinary size the lower part is looked at enlarged as well: plates and many signs of shops are small.
    """
    lines, first = find_lines(image), round(plates_top * len(image))
    closer: list[Line] = []
    if image.size <= 3 * SMALL and first < len(image):
        down = np.array([0, first])
        closer = [replace(line, corners=line.corners + down) for line in find_lines(image[first:], CLOSER)]
    # of a plate that is found twice both boxes are hidden
    plates = [line.box for line in (*lines, *closer) if is_plate(line, first)]
    return np.array(plates).reshape(-1, 4), joined(lines, closer)
