"""Detection of faces and number plates on a rectified facade of known scale: where they can be, at the density needed."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float32Array, UInt8Array
from facade_core.imagery.detect.detection import (
    LOWER_PART_SCALE,
    FacesPlatesAndText,
    detectors_available,
    find_plate_boxes,
)
from facade_core.imagery.detect.faces import FACE_ENLARGEMENT, find_faces_at_scale

# Heights above the lower border that heads and plates of what stands on the street do not reach, metres. A person is
# 2 m and a plate 1.2 m high; storeys, and so metres, may be half as large again as assumed, and a lorry's driver sits high.
MAX_HEAD_M = 5.0
MAX_PLATE_M = 3.0
# Densities at which the smallest faces (0.2 m) and plates (0.11 m), those at the wall, are 16 pixels high.
FACE_PIXELS_PER_METRE = 80.0
PLATE_PIXELS_PER_METRE = 145.0
# Faces above the street, on posters and behind windows, are at the wall. Below 8 pixels none can be recognised.
MIN_DENSITY_OF_FACES = 40.0
# Larger parts are searched at a scale of at least this.
MIN_SCALE = 0.25
# Factor of a second search for faces: those on posters and in profile are missed at one scale. Parts that then have more
# pixels are searched once: a megapixel takes a second of one core.
SECOND_SCALE = 2.0
MAX_SECOND_PIXELS = 2_500_000


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
    heads, plates = (max(0, height - round(metres * density)) for metres in (MAX_HEAD_M, MAX_PLATE_M))
    scale = max(MIN_SCALE, FACE_PIXELS_PER_METRE / density)
    faces = [_find_faces_twice(image[heads:], min(FACE_ENLARGEMENT, scale)) + np.array([0, heads, 0, heads])]
    if heads and density >= MIN_DENSITY_OF_FACES:
        faces.append(_find_faces_twice(image[:heads], min(1.0, scale)))
    scale = float(np.clip(PLATE_PIXELS_PER_METRE / density, 1.0, LOWER_PART_SCALE))
    found = find_plate_boxes(image[plates:], scale)
    return FacesPlatesAndText(np.concatenate(faces), found + np.array([0, plates, 0, plates]))


def _find_faces_twice(image: UInt8Array, scale: float) -> Float32Array:
    """Find the faces at a scale, and at SECOND_SCALE times it where the part is small enough; boxes (n, 4)."""
    found, second = [find_faces_at_scale(image, scale)], SECOND_SCALE * scale
    if image.shape[0] * image.shape[1] * second**2 <= MAX_SECOND_PIXELS:
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
    return FacesPlatesAndText(find_faces_at_scale(image, FACE_ENLARGEMENT), plates)
