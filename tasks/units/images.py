"""Image files into arrays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from facade_core.errors import ImageError

# Of a frame of 35 mm film, 36 x 24 mm.
DIAGONAL_35MM = math.hypot(36, 24)


def image_size(path: Path) -> tuple[int, int]:
    """Rows and columns of an image file, from its header."""
    from PIL import Image

    with Image.open(path) as image:
        return image.height, image.width


def focal_length(path: Path) -> float | None:
    """The focal length of a photo in pixels, from its EXIF 35 mm equivalent; None where that is not told."""
    from PIL import ExifTags, Image

    with Image.open(path) as image:
        told = image.getexif().get_ifd(ExifTags.IFD.Exif).get(ExifTags.Base.FocalLengthIn35mmFilm)
        diagonal = math.hypot(image.width, image.height)
    return float(told) * diagonal / DIAGONAL_35MM if told else None


def read_textures(paths: Sequence[Path], used: np.ndarray) -> dict[int, np.ndarray]:
    """The pictures (h, w, 3) uint8 of those indices into `paths` that are used; negative ones stand for none."""
    return {int(i): read_image(paths[i])[0] for i in np.unique(used[used >= 0])}


@lru_cache(maxsize=2)
def read_panorama(path: Path) -> np.ndarray:
    """A panorama (h, w, 3) uint8; facades of one building come one after the other and share it."""
    return read_image(path)[0]


def read_image(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """An image file as RGB (h, w, 3) uint8, turned as its EXIF says, and its hidden part (h, w) bool: where alpha < 128."""
    from PIL import Image, ImageOps, UnidentifiedImageError

    try:
        with Image.open(path) as image:
            upright = ImageOps.exif_transpose(image)
            alpha = upright.getchannel("A") if "A" in upright.getbands() else None
            if upright.mode.startswith("I"):  # 16 bits a pixel, which the library would clip, not scale
                upright = Image.fromarray((np.asarray(upright, np.uint32) >> 8).astype(np.uint8))
            rgb = np.asarray(upright.convert("RGB"))
            hidden = np.asarray(alpha) < 128 if alpha is not None else np.zeros(rgb.shape[:2], bool)
    except (OSError, UnidentifiedImageError, Image.DecompressionBombError) as error:
        raise ImageError(f"{path.name}: not a readable image ({error}); replace or remove it") from error
    return rgb, hidden
