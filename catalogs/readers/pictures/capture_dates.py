"""Day, focal length and exposure of pictures by EXIF."""

from __future__ import annotations

import math
from datetime import datetime
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from PIL.Image import Image

# Of a frame of 35 mm film, 36 x 24 mm.
DIAGONAL_35MM = math.hypot(36, 24)


class CaptureState(NamedTuple):
    """How a picture was taken, as its EXIF states.

    Attributes
    ----------
    day : day, as "2024-05-17"; None if unknown.
    focal_px : focal length in pixels; None if unknown.
    exposure : exposure value at ISO 100; None if unknown.
    """

    day: str | None = None
    focal_px: float | None = None
    exposure: float | None = None


def exif_capture_state(image: Image) -> CaptureState:
    """Return how a picture was taken; the focal length is in pixels of the file."""
    return CaptureState(exif_capture_date(image), exif_focal_length_px(image), exif_exposure_value(image))


def exif_focal_length_px(image: Image) -> float | None:
    """Return the focal length in pixels of the file, from the 35 mm equivalent; None if unknown."""
    from PIL import ExifTags

    try:
        exif = image.getexif().get_ifd(ExifTags.IFD.Exif)
        focal_mm = float(exif.get(ExifTags.Base.FocalLengthIn35mmFilm) or 0)
    except Exception:  # damaged in any way
        return None
    return focal_mm * math.hypot(image.width, image.height) / DIAGONAL_35MM if 0 < focal_mm < math.inf else None


def exif_exposure_value(image: Image) -> float | None:
    """Return the exposure value at ISO 100; None if unknown."""
    from PIL import ExifTags

    try:
        exif = image.getexif().get_ifd(ExifTags.IFD.Exif)
        aperture, seconds = float(exif[ExifTags.Base.FNumber]), float(exif[ExifTags.Base.ExposureTime])
        sensitivity = float(np.max(exif.get(ExifTags.Base.ISOSpeedRatings) or 100))
        exposure = math.log2(aperture**2 / seconds * 100 / sensitivity)
    except Exception:  # none, or damaged in any way
        return None
    return exposure if math.isfinite(exposure) else None


def exif_capture_date(image: Image) -> str | None:
    """Return the capture date as "2024-05-17"; None without one in EXIF."""
    from PIL import ExifTags

    try:
        exif = image.getexif().get_ifd(ExifTags.IFD.Exif)
        date_time = exif.get(ExifTags.Base.DateTimeOriginal) or exif.get(ExifTags.Base.DateTimeDigitized)
        return datetime.strptime(str(date_time)[:10], "%Y:%m:%d").date().isoformat()
    except Exception:  # damaged EXIF, or an impossible date
        return None
