"""Conversion of pictures of more than 8 bits per band (16, 32, float) by the range of their values, and of stated bands."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from catalogs.readers.gdal_files import open_raster_dataset
from catalogs.readers.pictures.colour_bands import find_colour_bands
from catalogs.readers.settings import PICTURES
from facade_core.core.arrays import BoolArray, Float32Array, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.regular_files import open_regular

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike
    from PIL.Image import Image
    from rasterio.io import DatasetReader
    from rasterio.windows import Window

REMEDY = "save it as PNG or JPEG of 8 bits"
# TIFF tags and value.
_BITS_PER_SAMPLE_TAG = 258
_SAMPLE_FORMAT_TAG = 339
_UNSIGNED_FORMAT = 1
_GDAL_METADATA_TAG = 42112
_PHOTOMETRIC_TAG = 262
_YCBCR = 6
_BAND_MEANING = re.compile('role="(colorinterp|description)"')


def needs_rasterio(image: Image) -> bool:
    """Return True where Pillow would clip values, cut them to the upper 8 bits, or miss what GDAL states of bands."""
    from PIL.ImageFile import ImageFile

    if image.mode.startswith(("I", "F")):
        return True
    tags: Mapping[int, ArrayLike] = getattr(image, "tag_v2", {})
    bits, kinds = (np.atleast_1d(tags.get(tag, 1)).tolist() for tag in (_BITS_PER_SAMPLE_TAG, _SAMPLE_FORMAT_TAG))
    if max(bits) > 8 or any(kind != _UNSIGNED_FORMAT for kind in kinds):
        return True
    if (
        image.mode != "YCbCr"
        and tags.get(_PHOTOMETRIC_TAG) != _YCBCR
        and _BAND_MEANING.search(str(tags.get(_GDAL_METADATA_TAG, "")))
    ):
        return True
    tiles = image.tile if isinstance(image, ImageFile) else ()
    return image.format == "PNG" and any(";16" in str(tile.args) for tile in tiles)


def read_high_bit_depth(path: Path, factor: int) -> tuple[UInt8Array, BoolArray]:
    """Read a picture as 8-bit RGB, averaged over blocks of `factor` x `factor` pixels.

    Integers are scaled by the smallest of PICTURES.bit_depths that holds them all; fractions range to 1 or to 255.
    The file is read twice, a few rows at a time, so that memory does not grow with the file.

    Parameters
    ----------
    path : PNG or TIFF file.
    factor : side of a block, pixels.

    Returns
    -------
    rgb : (h, w, 3).
    hidden : (h, w) True where a pixel is transparent or no number.

    Raises
    ------
    ImageError
        Where the values have another range.
    """
    from rasterio.windows import Window

    options: dict[str, str | int] = {
        "GDAL_PAM_ENABLED": "NO",
        "GDAL_DISABLE_READDIR_ON_OPEN": "EMPTY_DIR",
        "GDAL_CACHEMAX": 64_000_000,
    }
    with open_regular(path) as file:
        driver = "PNG" if file.read(4) == b"\x89PNG" else "GTiff"
    with open_raster_dataset(path, driver, options) as raster:
        bands, transparent, inverted = _colour_bands(path, raster)
        step = factor * max(1, PICTURES.max_values_per_read // (raster.width * raster.count * factor))
        windows = [
            Window(0, row, raster.width, min(step, raster.height - row)) for row in range(0, raster.height, step)
        ]
        low, high, opaque = _value_ranges(raster, bands, transparent, windows)
        most = find_white(path, raster, np.array([low, high], np.float32))
        shape = (math.ceil(raster.height / factor), math.ceil(raster.width / factor))
        rgb, hidden = np.empty((*shape, 3), np.uint8), np.empty(shape, bool)
        for window in windows:
            values = read_values(raster, bands, window=window)
            known = np.asarray(np.isfinite(values).all(axis=0))
            if transparent:
                known &= raster.read(transparent, window=window) * 2.0 > opaque
            values = np.clip(np.where(known, values, 0.0) / np.float32(most), 0.0, 1.0)
            values = np.moveaxis(1.0 - values if inverted else values, 0, -1)
            part, seen = _block_means(values * known[..., None], known.astype(np.float32), factor)
            rows = slice(window.row_off // factor, window.row_off // factor + len(seen))
            colour = np.rint(255 * part / np.maximum(seen, 1e-9)[..., None])
            rgb[rows], hidden[rows] = colour.astype(np.uint8), seen < 0.5
    if hidden.all():
        raise ImageError(f"{path.name} has no pixel that is known and not transparent; replace or remove it")
    return rgb, hidden


def _colour_bands(path: Path, raster: DatasetReader) -> tuple[list[int], int | None, bool]:
    """Return the colour bands, the alpha band or None, and whether the lowest value is white."""
    from rasterio.enums import PhotometricInterp

    if raster.photometric in (PhotometricInterp.cmyk, PhotometricInterp.ycbcr, PhotometricInterp.cielab):
        raise ImageError(f"{path.name} is {raster.photometric.value} of {raster.dtypes[0]}; {REMEDY}")
    bands = find_colour_bands(raster, path.name)
    return list(bands.colours), bands.alpha, is_inverted(raster)


def is_inverted(raster: DatasetReader) -> bool:
    """Return True where the lowest value is white."""
    return str(raster.tags(ns="IMAGE_STRUCTURE").get("MINISWHITE", "")).upper() == "YES"


def _value_ranges(
    raster: DatasetReader, bands: list[int], transparent: int | None, windows: Iterable[Window]
) -> tuple[float, float, float]:
    """Return the lowest and the highest known value of the colours, and the highest of the alpha band."""
    low, high, opaque = math.inf, -math.inf, 0.0
    for window in windows:
        values = read_values(raster, bands, window=window)
        finite = values[:, np.isfinite(values).all(axis=0)]
        low, high = float(finite.min(initial=low)), float(finite.max(initial=high))
        if transparent:
            opaque = max(opaque, float(raster.read(transparent, window=window).max()))
    return low, high, opaque


def read_values(raster: DatasetReader, bands: Sequence[int], **options: Any) -> Float32Array:
    """Return scaled values (bands, rows, columns), NaN for nodata, read with options of rasterio."""
    values = raster.read(list(bands), **options)
    if np.iscomplexobj(values):
        raise ImageError(f"{Path(raster.name).name} has complex values; {REMEDY}")
    nodata, scales, offsets = (
        np.array([of_bands[band - 1] for band in bands], np.float64)[:, None, None]
        for of_bands in (raster.nodatavals, raster.scales, raster.offsets)
    )
    unknown = values == nodata
    values = (values * scales + offsets).astype(np.float32)
    values[unknown] = np.nan
    return np.asarray(values)


def find_white(path: Path, raster: DatasetReader, values: Float32Array) -> float:
    """Return the value of white: 1 or 255 of fractions, else that of the fewest bits that hold all values.

    Parameters
    ----------
    path : file, for messages.
    raster : open raster.
    values : scaled values, NaN where unknown.

    Raises
    ------
    ImageError
        Where they are no colours.
    """
    finite = values[np.isfinite(values)]
    low, high = float(finite.min(initial=math.inf)), float(finite.max(initial=-math.inf))
    kind = "floating point" if any(scale != 1 for scale in raster.scales) else raster.dtypes[0]
    if high < low:
        raise ImageError(f"{path.name} has no pixel that is a number; replace or remove it")
    if low == high == 0:
        return 1.0
    if kind == "uint8":
        return 255.0
    span = f"{path.name} has values from {low:g} to {high:g} ({kind})"
    if kind.startswith("float"):
        white = 1.0 if high <= 1.05 else 255.0
        wanted = "0 to 1 nor 0 to 255"
        fits = low >= -0.05 * white and white / 255 * PICTURES.min_peak_value <= high <= 1.05 * white
    else:
        white = next((2.0**bits - 1 for bits in PICTURES.bit_depths if high < 2**bits), 0.0)
        wanted = "0 to 255 nor 0 to 65535"
        fits = low >= 0 and PICTURES.min_peak_value <= high <= white
    if not fits:
        raise ImageError(f"{span}, which are neither {wanted}; {REMEDY}")
    return white


def _block_means(values: Float32Array, known: Float32Array, factor: int) -> tuple[Float32Array, Float32Array]:
    """Return means of values (h, w, 3) and of known (h, w) over blocks of `factor` pixels, smaller at the border."""
    if factor == 1:
        return values, known
    down, across = (np.arange(0, side, factor) for side in known.shape)
    counts = np.outer(np.diff([*down, known.shape[0]]), np.diff([*across, known.shape[1]]))
    total = np.add.reduceat(np.add.reduceat(values, down, axis=0), across, axis=1)
    seen = np.add.reduceat(np.add.reduceat(known, down, axis=0), across, axis=1)
    return total / counts[..., None], seen / counts
