"""Conversion of colours to sRGB by the ICC profile that a picture embeds, or by the colour space that its tags state."""

from __future__ import annotations

import io
import logging
import struct
from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from catalogs.readers.settings import PICTURES
from facade_core.core.arrays import UInt8Array

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageCms import ImageCmsTransform

log = logging.getLogger(__name__)

# Primaries (red, green, blue) as XYZ under D50, and exponents, of colour spaces that pictures state without a profile.
_ADOBE_RGB = ((0.60974, 0.31111, 0.01947), (0.20528, 0.62567, 0.06087), (0.14919, 0.06322, 0.74457)), 563 / 256
_LINEAR_SRGB = ((0.43607, 0.22249, 0.01392), (0.38515, 0.71687, 0.09708), (0.14307, 0.06061, 0.71410)), 1.0
_D50 = (0.9642, 1.0, 0.8249)
_INTEROPERABILITY_IFD = 0xA005  # of EXIF
_ADOBE_RGB_INDEX = "R03"  # tag 1 of it, in pictures of cameras that are set to Adobe RGB
_COLOUR_SPACE = slice(16, 20)  # of the header of a profile
_MODES = {b"RGB ": "RGB", b"GRAY": "L", b"CMYK": "CMYK"}


class ColourProfile:
    """ICC profile of a picture, as a conversion to sRGB.

    Attributes
    ----------
    mode : Pillow's mode of the colours that the profile describes.
    """

    def __init__(self, mode: str, transform: ImageCmsTransform) -> None:
        self.mode = mode
        self._transform = transform

    def convert(self, image: Image) -> Image:
        """Return an image of this mode in sRGB."""
        return self._transform.apply(image)

    def convert_array(self, rgb: UInt8Array) -> UInt8Array:
        """Return colours (h, w, 3) in sRGB; those of a grey profile have equal bands."""
        from PIL import Image

        image = Image.fromarray(rgb if self.mode == "RGB" else np.ascontiguousarray(rgb[..., 0]))
        return np.asarray(self.convert(image))


def find_profile(image: Image) -> bytes | None:
    """Return the embedded profile of a picture, else that of the colour space that EXIF or gAMA state; None for sRGB."""
    embedded = image.info.get("icc_profile")
    if isinstance(embedded, bytes) and embedded:
        return embedded
    try:
        index = str(image.getexif().get_ifd(_INTEROPERABILITY_IFD).get(1, ""))
    except Exception:  # damaged EXIF raises errors of any class
        index = ""
    if index.startswith(_ADOBE_RGB_INDEX):
        return _encode_profile(*_ADOBE_RGB)
    gamma = image.info.get("gamma")
    if (
        image.format == "PNG"
        and "srgb" not in image.info
        and isinstance(gamma, float)
        and gamma >= PICTURES.min_linear_gamma
    ):
        return _encode_profile(*_LINEAR_SRGB)
    return None


def _encode_profile(primaries: Sequence[Sequence[float]], exponent: float) -> bytes:
    """Return an ICC profile of three primaries and one curve (ICC.1:2001-04)."""

    def xyz(values: Sequence[float]) -> bytes:
        return struct.pack(">4s4x3i", b"XYZ ", *(round(65536 * value) for value in values))

    curve = struct.pack(">4s4xIH2x", b"curv", 1, round(256 * exponent))
    text = b"none\0"
    tags = {
        b"desc": struct.pack(">4s4xI", b"desc", len(text)) + text + bytes(78 + -(12 + len(text) + 78) % 4),
        b"cprt": struct.pack(">4s4x", b"text") + text + bytes(3),
        b"wtpt": xyz(_D50),
        **{name: xyz(values) for name, values in zip((b"rXYZ", b"gXYZ", b"bXYZ"), primaries, strict=True)},
        **dict.fromkeys((b"rTRC", b"gTRC", b"bTRC"), curve),
    }
    table, body = struct.pack(">I", len(tags)), b""
    for name, content in tags.items():
        table += struct.pack(">4sII", name, 132 + 12 * len(tags) + len(body), len(content))
        body += content
    white = struct.pack(">3i", *(round(65536 * value) for value in _D50))
    head = struct.pack(">I4xI4s4s4s12x4s28x", 128 + len(table + body), 0x02100000, b"mntr", b"RGB ", b"XYZ ", b"acsp")
    return (head + white).ljust(128, b"\0") + table + body


def profile_to_srgb(content: object, modes: tuple[str, ...]) -> ColourProfile | None:
    """Return the conversion of an embedded profile to sRGB.

    A damaged profile, or one of other colours than the picture's, is ignored, as browsers do.

    Parameters
    ----------
    content : bytes of the profile, if there is one.
    modes : modes that the picture's colours can be given in.

    Returns
    -------
    The conversion, or None where colours are sRGB already, or count as such.
    """
    if not isinstance(content, bytes) or not 128 < len(content) <= PICTURES.max_profile_bytes:
        return None
    mode = _MODES.get(content[_COLOUR_SPACE])
    return _build_profile(content, mode) if mode in modes else None


@lru_cache(maxsize=4)
def _build_profile(content: bytes, mode: str) -> ColourProfile | None:
    from PIL import ImageCms

    try:
        transform = ImageCms.buildTransform(
            ImageCms.ImageCmsProfile(io.BytesIO(content)),
            ImageCms.createProfile("sRGB"),
            mode,
            "RGB",
            ImageCms.Intent.RELATIVE_COLORIMETRIC,
            ImageCms.Flags.BLACKPOINTCOMPENSATION,
        )
        profile = ColourProfile(mode, transform)
        if mode == "CMYK":
            return profile
        steps = np.linspace(0, 255, 6).astype(np.uint8)
        probe = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(36, 6, 3)
        if mode == "L":
            probe = np.repeat(np.arange(256, dtype=np.uint8)[None, :, None], 3, axis=2)
        moved = profile.convert_array(probe).astype(np.int16) - probe
    except (ImageCms.PyCMSError, OSError, ValueError, TypeError):
        log.debug("a colour profile is ignored", exc_info=True)
        return None
    return profile if np.abs(moved).max() > PICTURES.max_srgb_error else None
