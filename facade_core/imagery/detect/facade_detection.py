"""Detection of faces and number plates on a rectified facade of known scale: where they can be, at the density needed."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float32Array, UInt8Array
from facade_core.imagery.detect.detection import FacesPlatesAndText, detectors_available, find_plate_boxes
from facade_core.imagery.detect.faces import find_faces_at_scale
from facade_core.imagery.detect.settings import DETECTION


def detect_on_facade(image: UInt8Array, metres_per_pixel: float) -> FacesPlatesAndText:
    """Detect the faces and plates on a rectified facade; nothing without the models.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    metres_per_pixel : scale; people and cars before the facade are larger.
    """
    if not detectors_available():
        return FacesPlatesAndText()
    density, height = 1 / metres_per_pixel, len(image)
    heads, plates = (
        max(0, height - round(metres * density)) for metres in (DETECTION.max_head_m, DETECTION.max_plate_m)
    )
    scale = max(DETECTION.min_scale, DETECTION.face_pixels_per_metre / density)
    faces = [_find_faces_twice(image[heads:], min(DETECTION.face_enlargement, scale)) + np.array([0, heads, 0, heads])]
    if heads and density >= DETECTION.min_density_of_faces:
        faces.append(_find_faces_twice(image[:heads], min(1.0, scale)))
    scale = float(np.clip(DETECTION.plate_pixels_per_metre / density, 1.0, DETECTION.lower_part_scale))
    found = find_plate_boxes(image[plates:], scale)
    return FacesPlatesAndText(np.concatenate(faces), found + np.array([0, plates, 0, plates]))


def _find_faces_twice(image: UInt8Array, scale: float) -> Float32Array:
    """Find the faces at a scale, and at DETECTION.second_scale times it where the part is small enough; boxes (n, 4)."""
    found, second = [find_faces_at_scale(image, scale)], DETECTION.second_scale * scale
    if image.shape[0] * image.shape[1] * second**2 <= DETECTION.max_second_pixels:
        found.append(find_faces_at_scale(image, second))
    return np.concatenate(found)


def detect_on_thumbnail(image: UInt8Array) -> FacesPlatesAndText:
    """Detect faces and plates on a small picture (H, W, 3) of a street; nothing without the models.

    Plates are looked for in its lower half, at the detector's own enlargement.
    """
    if not detectors_available():
        return FacesPlatesAndText()
    middle = len(image) // 2
    plates = find_plate_boxes(image[middle:], 1.0) + np.array([0, middle, 0, middle])
    return FacesPlatesAndText(find_faces_at_scale(image, DETECTION.face_enlargement), plates)
