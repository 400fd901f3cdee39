"""Capture dates of pictures by EXIF."""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from PIL.Image import Image


def exif_capture_date(image: Image) -> str | None:
    """Return the capture date as "2024-05-17"; None without one in EXIF."""
    from PIL import ExifTags

    try:
        exif = image.getexif().get_ifd(ExifTags.IFD.Exif)
        date_time = exif.get(ExifTags.Base.DateTimeOriginal) or exif.get(ExifTags.Base.DateTimeDigitized)
        return datetime.strptime(str(date_time)[:10], "%Y:%m:%d").date().isoformat()
    except Exception:  # damaged EXIF, or an impossible date
        return None
