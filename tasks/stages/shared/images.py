"""Image files as arrays, none larger than its use needs."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

import numpy as np

from catalogs.readers.pictures.capture_dates import exif_capture_date
from catalogs.readers.pictures.decoding import Picture, open_picture, read_picture
from catalogs.readers.pictures.folders import label_map_path
from catalogs.readers.settings import PICTURES
from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.labels import CLASSES, UNKNOWN
from facade_core.core.types import Pose
from tasks.engine.outcome import collect_input_errors

# A picture is worked on at no more pixels than the widest panorama of a block has: 1300 a radian, a texel of 5 cm at 65 m.
MAX_PIXELS = 8192 * 4096
# A picture of a lens is worked on at no more pixels a radian: twice those of that panorama, a texel of 3 cm at 80 m.
MAX_LENS_PIXELS_PER_RADIAN = 2600
# Longest side of an exemplar in pixels, and of what is prepared from it in texels: 100 m at 20 texels per metre.
MAX_EXEMPLAR_SIDE = 2000


def image_size(path: Path) -> tuple[int, int]:
    """Return rows and columns of an image file, from its header."""
    with open_picture(path) as image:
        return image.height, image.width


def capture_date(path: Path) -> str | None:
    """Return the day of a picture from its EXIF, as "2024-05-17"; None if unknown."""
    with open_picture(path) as image:
        return exif_capture_date(image)


def read_textures(pictures: Mapping[int, Path], refused: list[Exception]) -> dict[int, UInt8Array]:
    """Read texture pictures by number, (h, w, 3) uint8; errors of unreadable ones are appended to `refused`."""
    found = {}
    for number, path in pictures.items():
        with collect_input_errors(refused):
            found[number] = read_image_and_mask(path)[0]
    return found


def max_picture_pixels(pose: Pose) -> int:
    """Return the pixels at which a posed picture is read at most; an aerial one sees surfaces from farther."""
    if pose.lens is None or pose.is_aerial:
        return MAX_PIXELS
    across, down = (side / focal for side, focal in zip(pose.lens.size, pose.lens.focal, strict=True))
    return max(1, min(MAX_PIXELS, round(across * down * MAX_LENS_PIXELS_PER_RADIAN**2)))


def read_panorama(path: Path, max_pixels: int = MAX_PIXELS) -> UInt8Array:
    """Read a panorama or a picture of a lens (h, w, 3) uint8; consecutive units share it."""
    state = path.stat()
    return _read_panorama(path, state.st_size, state.st_mtime_ns, max_pixels)


@lru_cache(maxsize=2)
def _read_panorama(path: Path, _size: int, _modified: int, max_pixels: int) -> UInt8Array:
    return read_picture(path, max_pixels=max_pixels).rgb


def read_image_and_mask(path: Path) -> tuple[UInt8Array, BoolArray]:
    """Read an image file as RGB (h, w, 3) uint8, and its hidden part (h, w) bool."""
    picture = read_bounded_picture(path)
    return picture.rgb, picture.hidden


def read_bounded_picture(path: Path, *, least: int = 1) -> Picture:
    """Read a picture of at most MAX_PIXELS; a larger one is reduced on reading."""
    return read_picture(path, max_pixels=MAX_PIXELS, min_side=least)


def read_photo(path: Path) -> Picture:
    """Read a photo of a facade, with how it was taken."""
    return read_bounded_picture(path, least=PICTURES.min_side_px)


def read_exemplar_picture(path: Path) -> Picture:
    """Read an exemplar, reduced to MAX_EXEMPLAR_SIDE."""
    return read_picture(path, max_side=MAX_EXEMPLAR_SIDE, min_side=PICTURES.min_side_px)


def read_labels(path: Path, shape: tuple[int, int]) -> UInt8Array | None:
    """Read the label map beside an exemplar at a size (h, w), uint8; None without one.

    Raises
    ------
    ImageError : it has other proportions, or unknown classes.
    """
    import cv2

    beside = label_map_path(path)
    if beside is None:
        return None
    with open_picture(beside) as image:
        labels = np.asarray(image if image.mode in ("L", "P") else image.convert("L"))
    known = np.isin(np.unique(labels), [*range(len(CLASSES)), UNKNOWN]).all()
    if (
        not known
        or abs(labels.shape[0] * shape[1] - labels.shape[1] * shape[0]) > labels.shape[0] + shape[0] + shape[1]
    ):
        raise ImageError(
            f"{beside.name} is no label map of {path.name}; give one grey value a class, at its size, or remove it"
        )
    return np.asarray(cv2.resize(labels, shape[::-1], interpolation=cv2.INTER_NEAREST), labels.dtype)
