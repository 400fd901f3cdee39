"""Decoding of pictures: accepted formats, size limits and value ranges.

Every picture becomes 8 bits per band or is rejected with a one-line error; none becomes black for an unknown range.
"""

from __future__ import annotations

import errno
import math
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catalogs.reader_errors import is_system_error, short_message
from catalogs.readers.pictures.capture_dates import CaptureState, exif_capture_state
from catalogs.readers.pictures.colour_profiles import ColourProfile, find_profile, profile_to_srgb
from catalogs.readers.pictures.high_depth import needs_rasterio, read_high_bit_depth
from catalogs.readers.pictures.picture_kinds import HEIF_REMEDY, can_read_heif, is_heif
from catalogs.readers.settings import PICTURES
from facade_core.core.arrays import AnyArray, BoolArray, UInt8Array
from facade_core.core.errors import ImageError, InputError
from facade_core.core.regular_files import open_regular

if TYPE_CHECKING:
    from PIL.Image import Image

# Formats with decoders inside Pillow: no other program is started and no other file is opened.
PILLOW_FORMATS = ("PNG", "JPEG", "TIFF", "WEBP", "BMP", "GIF")
REMEDY = "replace or remove it"
# Errors of one file: a broken sector, or no permission.
_FILE_ERRNOS = frozenset((errno.EIO, errno.EACCES, errno.EPERM))


@dataclass(frozen=True)
class Picture:
    """Decoded picture, upright.

    Attributes
    ----------
    rgb : (h, w, 3).
    hidden : (h, w) True where alpha is below one half or a value is unknown.
    scale : pixels per pixel of the file.
    state : how it was taken; the focal length in its own pixels.
    """

    rgb: UInt8Array
    hidden: BoolArray
    scale: float = 1.0
    state: CaptureState = field(default_factory=CaptureState)


def read_picture(
    path: Path, *, max_pixels: int = PICTURES.max_pixels, max_side: float = math.inf, min_side: int = 1
) -> Picture:
    """Read a picture as sRGB in the orientation of its EXIF; the first of several frames.

    An embedded colour profile is applied, or the colour space that EXIF or gAMA state.

    Larger pictures are reduced while they are decoded, by means of pixels.

    Parameters
    ----------
    path : file of one of PILLOW_FORMATS.
    max_pixels : limit of the result.
    max_side : limit of the longer side of the result, pixels.
    min_side : minimum of the shorter side of the result, pixels.

    Raises
    ------
    ImageError
        One line with the file name and the remedy, for an unreadable file, another format, too many pixels, a side below
        `min_side`, or values that are no colours.
    """
    with open_picture(path) as image:
        width, height = image.size
        scale = min(1.0, math.sqrt(max_pixels / (width * height)), max_side / max(width, height))
        size = (round(height * scale), round(width * scale))
        if min(size) < min_side:
            small = f" ({size[1]} x {size[0]} where its longer side is reduced to {max(size)})" if scale < 1 else ""
            raise ImageError(
                f"{path.name} is {width} x {height} pixels{small}, and {min_side} a side are the least; give a larger picture"
            )
        deep = needs_rasterio(image)
        turned, state = _exif_orientation(image), exif_capture_state(image)  # decodes a PNG
        if deep:
            if image.format == "TIFF" and turned >= 5:
                size = size[::-1]  # read_high_depth returns stored values
            rgb, hidden = read_high_bit_depth(path, max(1, math.floor(1 / scale)))
            if profile := profile_to_srgb(find_profile(image), _profile_modes(image)):
                rgb = profile.convert_array(rgb)
        else:
            image.draft(None, (size[1], size[0]))  # decodes a JPEG at a half, a quarter or an eighth
            image.load()
            turned = 1 if image.format == "TIFF" else turned  # Pillow rotates TIFF
            rgb, hidden = _convert_to_rgb(image, max(1, min(image.height // size[0], image.width // size[1])))
        if rgb.shape[:2] != size:
            import cv2

            rgb = np.asarray(cv2.resize(rgb, size[::-1], interpolation=cv2.INTER_AREA), np.uint8)
            hidden = cv2.resize(hidden.astype(np.uint8), size[::-1], interpolation=cv2.INTER_NEAREST).astype(bool)
    if state.focal_px is not None:
        state = state._replace(focal_px=state.focal_px * scale)
    return Picture(_rotate_upright(rgb, turned), _rotate_upright(hidden, turned), scale, state)


@contextmanager
def open_picture(path: Path) -> Iterator[Image]:
    """Open a picture and read its header.

    Raises
    ------
    ImageError
        For any defect of the content; errors of the machine pass through.
    """
    from PIL import Image, UnidentifiedImageError

    formats: tuple[str, ...] = PILLOW_FORMATS
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # damaged parts are rejected or skipped
            if _is_heif_file(path):
                formats = _heif_formats(path)
            # a file object: by name Pillow maps files into memory, which rotates them wrongly and crashes where they shrink
            with open_regular(path) as file, Image.open(file, formats=formats) as image:
                _check_size(path, image)
                yield image
    except ImageError:
        raise
    except Image.DecompressionBombError as error:
        raise _size_error(path, PICTURES.max_pixels) from error
    except UnidentifiedImageError as error:
        raise ImageError(_unidentified_message(path)) from error
    except Exception as error:  # decoders raise errors of any class
        if is_system_error(error) and not (isinstance(error, OSError) and is_unreadable_file(error)):
            raise
        raise ImageError(_defect_message(path, error)) from error


def _unidentified_message(path: Path) -> str:
    if path.stat().st_size == 0:
        return f"{path.name} is empty; copy it again, or remove it"
    return (
        f"{path.name} cannot be opened as a picture: it is none of {', '.join(PILLOW_FORMATS)}, "
        "or a variant that is not read; save it as PNG or JPEG of 8 bits"
    )


def _defect_message(path: Path, error: Exception) -> str:
    """Return the message for an error of a decoder, or of opening a file."""
    if isinstance(error, OSError) and is_unreadable_file(error):
        return unreadable_message(path, error)
    if isinstance(error, InputError):  # a folder, a pipe or a device
        return str(error)
    if "image file is truncated" in str(error):
        return f"{path.name} is cut off; {REMEDY}"
    reason = error.strerror if isinstance(error, OSError) and error.strerror else short_message(error)
    return f"{path.name} cannot be opened as a picture ({reason}); {REMEDY}"


def is_unreadable_file(error: OSError) -> bool:
    """Return True where an error concerns one file, such as a broken sector or its permissions, not the whole machine."""
    return error.errno in _FILE_ERRNOS


def unreadable_message(path: Path, error: OSError) -> str:
    """Return the message with the remedy for a picture that cannot be read."""
    remedy = "copy it again, or remove it" if error.errno == errno.EIO else "check its permissions, or remove it"
    return f"{path.name} cannot be read ({error.strerror or os.strerror(error.errno or 0)}); {remedy}"


def _is_heif_file(path: Path) -> bool:
    with open_regular(path) as file:
        return is_heif(file.read(12))


def _heif_formats(path: Path) -> tuple[str, ...]:
    """Return the formats of a HEIC file, once the package that reads it is registered."""
    if not can_read_heif():
        raise ImageError(f"{path.name} is HEIC, which is not read here; {HEIF_REMEDY}")
    import pillow_heif

    pillow_heif.register_heif_opener(thumbnails=False)
    return ("HEIF",)


def _check_size(path: Path, image: Image) -> None:
    width, height = image.size
    most = PICTURES.max_webp_pixels if image.format == "WEBP" else PICTURES.max_pixels
    if width * height > most:
        raise _size_error(path, most)
    if min(width, height) < 1:
        raise ImageError(f"{path.name} is {width} x {height} pixels; {REMEDY}")


def _size_error(path: Path, max_pixels: int) -> ImageError:
    return ImageError(f"{path.name} has more than {max_pixels // 1_000_000} megapixels; reduce it")


def _convert_to_rgb(image: Image, factor: int) -> tuple[UInt8Array, BoolArray]:
    """Return RGB and the hidden mask of a decoded image, averaged over blocks of `factor` x `factor` pixels.

    The image is converted in strips, since conversions hold copies.
    """
    width, height = image.size
    rows, columns = math.ceil(height / factor), math.ceil(width / factor)
    rgb, hidden = np.empty((rows, columns, 3), np.uint8), np.zeros((rows, columns), bool)
    step = max(1, PICTURES.strip_pixels // (width * factor))
    transparent = image.has_transparency_data
    profile = profile_to_srgb(find_profile(image), _profile_modes(image))
    for row in range(0, rows, step):
        strip = image.crop((0, row * factor, width, min(height, (row + step) * factor)))
        colour = _to_rgba(strip, profile) if transparent else _to_rgb(strip, profile)
        if factor > 1:
            colour = colour.reduce(factor)
        values = np.asarray(colour)
        rgb[row : row + step] = values[..., :3]
        if transparent:
            hidden[row : row + step] = values[..., 3] < 128
    return rgb, hidden


def _profile_modes(image: Image) -> tuple[str, ...]:
    """Return the modes of the profiles that can describe the colours of an image."""
    if image.mode == "CMYK":
        return ("CMYK",)
    return ("RGB", "L") if image.mode in ("1", "L", "LA", "La") or image.mode.startswith(("I", "F")) else ("RGB",)


def _to_rgba(image: Image, profile: ColourProfile | None) -> Image:
    whole = image.convert("RGBA")
    if profile is not None:
        alpha = whole.getchannel("A")
        whole = profile.convert(whole.convert(profile.mode))
        whole.putalpha(alpha)
    return whole


def _to_rgb(image: Image, profile: ColourProfile | None) -> Image:
    if profile is not None:
        return profile.convert(image.convert(profile.mode))
    if image.mode == "LAB":
        from PIL import ImageCms

        own, srgb = ImageCms.createProfile("LAB"), ImageCms.createProfile("sRGB")
        converted = ImageCms.profileToProfile(image, own, srgb, outputMode="RGB")
        assert converted is not None, "it is not converted in place"
        return converted
    return image.convert("RGB")


def _exif_orientation(image: Image) -> int:
    """Return the EXIF orientation, 1 to 8; 1 where the EXIF is damaged."""
    try:
        found = int(image.getexif().get(0x0112, 1))
    except Exception:  # damaged EXIF raises errors of any class
        return 1
    return found if 1 <= found <= 8 else 1


def _rotate_upright(values: AnyArray, orientation: int) -> AnyArray:
    if orientation in (5, 6, 7, 8):
        values = values.swapaxes(0, 1)
    if orientation in (3, 4, 7, 8):
        values = values[::-1]
    if orientation in (2, 3, 6, 7):
        values = values[:, ::-1]
    return np.ascontiguousarray(values)
