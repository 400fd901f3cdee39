"""Detection of faces, number plates and text on pictures, where the optional models are installed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, FloatArray, UInt8Array
from facade_core.core.types import Box, Pose
from facade_core.imagery.detect.faces import find_faces
from facade_core.imagery.detect.models import models_digest
from facade_core.imagery.detect.plates import has_plate_shape, is_plate
from facade_core.imagery.detect.settings import DETECTION
from facade_core.imagery.detect.text import TextLine, find_text_lines, merge_line_detections


def _no_boxes() -> Float64Array:
    return np.zeros((0, 4))


@dataclass(frozen=True, slots=True, eq=False)
class FacesPlatesAndText:
    """Detected faces, number plates and lines of text of one picture.

    Attributes
    ----------
    faces : (n, 4) boxes x0, y0, x1, y1 in pixels.
    plates : (m, 4) boxes of number plates.
    lines : lines of text, including those of the plates.
    """

    faces: FloatArray = field(default_factory=_no_boxes)
    plates: Float64Array = field(default_factory=_no_boxes)
    lines: Sequence[TextLine] = ()

    def has_private_boxes(self) -> bool:
        """Return True if there is a face or a plate to hide."""
        return len(self.faces) + len(self.plates) > 0

    def rescale(self, across: float, down: float) -> FacesPlatesAndText:
        """Return the detections for the picture at another size, by factors across and down."""
        both = np.array([across, down])
        lines = [replace(line, corners=line.corners * both) for line in self.lines]
        return FacesPlatesAndText(self.faces * np.tile(both, 2), self.plates * np.tile(both, 2), lines)

    def translate(self, across: float, down: float) -> FacesPlatesAndText:
        """Return the detections for a larger picture in which this one begins at the given pixel."""
        both = np.array([across, down])
        lines = [replace(line, corners=line.corners + both) for line in self.lines]
        return FacesPlatesAndText(self.faces + np.tile(both, 2), self.plates + np.tile(both, 2), lines)

    def private_boxes(self, shape: tuple[int, int]) -> tuple[Box, ...]:
        """Return the boxes to hide in a picture (H, W), in whole pixels, faces first."""
        boxes = []
        for x0, y0, x1, y1 in np.concatenate([self.faces, self.plates]).tolist():
            rim = DETECTION.hidden_rim_share * max(x1 - x0, y1 - y0)
            left, top = max(0, int(x0 - rim)), max(0, int(y0 - rim))
            right, bottom = min(shape[1], int(x1 + rim) + 1), min(shape[0], int(y1 + rim) + 1)
            boxes.append((left, top, right, bottom))
        return tuple(boxes)

    def private_mask(self, shape: tuple[int, int]) -> BoolArray:
        """Return the pixels (H, W) bool to hide."""
        mask = np.zeros(shape, bool)
        for x0, y0, x1, y1 in self.private_boxes(shape):
            mask[y0:y1, x0:x1] = True
        return mask


def detectors_available() -> bool:
    """Return True if the packages that contain the detection models are installed."""
    return bool(models_digest())


def detect_faces_plates_text(image: UInt8Array, plates_top: float = DETECTION.plates_top_share) -> FacesPlatesAndText:
    """Detect faces, plates and text on an image; nothing without the models.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    plates_top : share of the height below which plates are accepted.
    """
    if not detectors_available():
        return FacesPlatesAndText()
    plates, lines = find_plates_and_text(image, plates_top)
    return FacesPlatesAndText(find_faces(image)[0], plates, lines)


def detect_on_panorama_strip(image: UInt8Array, plates_top: float = DETECTION.plates_top_share) -> FacesPlatesAndText:
    """Detect faces, plates and text on a full-turn panorama strip, whose left and right borders meet.

    Objects across the border are detected whole, and returned at both sides.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    plates_top : share of the height below which plates are accepted.
    """
    width = image.shape[1]
    detections = detect_faces_plates_text(
        np.concatenate([image, image[:, : DETECTION.seam_overlap_px]], axis=1), plates_top
    )
    lines = [line for line in detections.lines if line.box[0] < width]
    return FacesPlatesAndText(_wrap_boxes(detections.faces, width), _wrap_boxes(detections.plates, width), lines)


def detect_on_panorama(image: UInt8Array, pose: Pose) -> FacesPlatesAndText:
    """Detect faces, plates and text on a panorama, in a band of its full height, or on a picture of a lens.

    Parameters
    ----------
    image : (H, W, 3) uint8, the part `pose.view` of the full panorama.
    pose : pose of the camera.
    """
    if pose.lens is not None:
        return detect_faces_plates_text(image)
    _, top, wide, share = pose.view
    first, middle, last = (
        min(len(image), max(0, round((row - top) / share * len(image))))
        for row in (DETECTION.search_top_share, DETECTION.horizon_share, DETECTION.search_bottom_share)
    )
    if last == first:
        return FacesPlatesAndText()
    detect = detect_on_panorama_strip if wide == 1 else detect_faces_plates_text
    return detect(image[first:last], (middle - first) / (last - first)).translate(0, first)


def _wrap_boxes(boxes: FloatArray, width: int) -> Float64Array:
    """Boxes (n, 4) of a continued strip as boxes of the strip; a box across the border is returned twice."""
    wrapped = boxes[boxes[:, 0] < width]
    rest = wrapped[wrapped[:, 2] > width] - np.array([width, 0, width, 0])
    return np.asarray(np.concatenate([wrapped, rest]), np.float64)


def find_plates_and_text(
    image: UInt8Array, plates_top: float = DETECTION.plates_top_share
) -> tuple[Float64Array, list[TextLine]]:
    """Find number plates and all lines of text.

    The lower part of pictures of ordinary size is searched enlarged as well: plates and many shop signs are small.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    plates_top : share of the height below which plates are accepted.

    Returns
    -------
    Boxes (n, 4) of the plates, and the lines of text.
    """
    lines, first_row = find_text_lines(image), round(plates_top * len(image))
    enlarged_lines: list[TextLine] = []
    if image.size <= 3 * DETECTION.max_enlarged_pixels and first_row < len(image):
        offset = np.array([0, first_row])
        enlarged_lines = [
            replace(line, corners=line.corners + offset)
            for line in find_text_lines(image[first_row:], DETECTION.lower_part_scale)
        ]
    # both boxes of a plate that is found twice are hidden
    plates = [line.box for line in (*lines, *enlarged_lines) if is_plate(line, first_row)]
    return np.array(plates).reshape(-1, 4), merge_line_detections(lines, enlarged_lines)


def find_plate_boxes(image: UInt8Array, scale: float) -> Float64Array:
    """Find the number plates anywhere in an image (H, W, 3), enlarged by `scale`; boxes (n, 4)."""
    lines = find_text_lines(image, scale, has_plate_shape)
    return np.array([line.box for line in lines if is_plate(line, 0.0)]).reshape(-1, 4)
