"""Conversion of colours to sRGB by the ICC profile that a picture embeds."""

from __future__ import annotations

import io
import logging
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from facade_core.core.arrays import UInt8Array

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageCms import ImageCmsTransform

log = logging.getLogger(__name__)

# Largest profile that is read: those of printing presses have up to 3 MB.
MAX_PROFILE_BYTES = 20_000_000
# Profiles that move no colour by more than this, of 255, are sRGB by another name.
MAX_SRGB_ERROR = 3
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
    if not isinstance(content, bytes) or not 128 < len(content) <= MAX_PROFILE_BYTES:
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
    return profile if np.abs(moved).max() > MAX_SRGB_ERROR else None
