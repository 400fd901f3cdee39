"""Texture encoders of tiles: JPEG, WebP, and KTX2 with Basis Universal, which stays compressed on the graphics card."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass

from facade_core.core.arrays import UInt8Array
from facade_core.core.errors import InputError
from facade_core.export.models.pages import encode_jpeg
from facade_core.export.models.settings import TEXTURE_ENCODERS

# Memory of a texture with its mipmaps relative to the texture.
MIPMAP_FACTOR = 4 / 3


@dataclass(frozen=True)
class TextureEncoder:
    """Encoder of texture pages, for colours and for data such as normals.

    Attributes
    ----------
    mime_type : MIME type of an encoded image.
    extension : glTF extension by which a texture names its image; None for formats of core glTF.
    bytes_per_texel : upper bound of graphics memory per texel.
    max_view_mb : default limit for the textures of a view, MB.
    encode : encodes a colour image (h, w, 3) uint8.
    encode_data : encodes a data image (h, w, 3) uint8.
    """

    mime_type: str
    extension: str | None
    bytes_per_texel: float
    max_view_mb: float
    encode: Callable[[UInt8Array], bytes]
    encode_data: Callable[[UInt8Array], bytes]


def texture_encoder(name: str) -> TextureEncoder:
    """Return the encoder of a name in ENCODERS.

    Raises
    ------
    InputError : the encoder needs a package that is not installed.
    """
    if name == "ktx2":
        try:
            import alktx2  # noqa: F401
        except ImportError as error:
            raise InputError("--textures ktx2: its encoder is not installed; `make ktx2-setup` adds it") from error
    return ENCODERS[name]


def _webp(image: UInt8Array) -> bytes:
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, "WEBP", quality=TEXTURE_ENCODERS.webp_quality, method=4)
    return buffer.getvalue()


def _jpeg_data(image: UInt8Array) -> bytes:
    """Encode without chroma subsampling, so that normals keep the resolution of their directions."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, "JPEG", quality=TEXTURE_ENCODERS.jpeg_data_quality, subsampling=0)
    return buffer.getvalue()


def _ktx2(image: UInt8Array, srgb: bool = True) -> bytes:
    """Encode as ETC1S with mipmaps; the bytes do not depend on the number of threads."""
    import alktx2
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, "PNG", compress_level=1)
    encoded: bytes = alktx2.encode_bytes_to_ktx2(
        buffer.getvalue(),
        mime="image/png",
        codec="etc1s",
        quality=TEXTURE_ENCODERS.etc1s_quality,
        effort=TEXTURE_ENCODERS.etc1s_effort,
        srgb=srgb,
        mipmaps=True,
        mip_wrap=False,
        check_for_alpha=False,
    )
    return encoded


# Graphics cards hold ETC1S as BC7, ETC2 or ASTC with at most a byte per texel, and the other formats as RGBA.
ENCODERS = {
    "jpeg": TextureEncoder("image/jpeg", None, 4.0, TEXTURE_ENCODERS.max_view_mb, encode_jpeg, _jpeg_data),
    "webp": TextureEncoder("image/webp", "EXT_texture_webp", 4.0, TEXTURE_ENCODERS.max_view_mb, _webp, _webp),
    "ktx2": TextureEncoder(
        "image/ktx2",
        "KHR_texture_basisu",
        1.0,
        TEXTURE_ENCODERS.max_ktx2_view_mb,
        _ktx2,
        lambda image: _ktx2(image, srgb=False),
    ),
}
