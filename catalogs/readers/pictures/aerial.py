"""Orthophotos, sampled at positions in the frame of a block."""

from __future__ import annotations

import base64
import hashlib
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from catalogs.file_digest import file_digest
from catalogs.readers.pictures.colour_bands import find_colour_bands
from catalogs.readers.pictures.colour_profiles import ColourProfile, profile_to_srgb
from catalogs.readers.pictures.high_depth import find_white, is_inverted, read_values
from catalogs.readers.pictures.rasters import (
    RASTER_DRIVERS,
    check_georeference,
    coverage_message,
    detect_driver,
    open_raster,
    read_raster_crs,
)
from catalogs.readers.pictures.virtual_rasters import check_virtual_raster
from catalogs.readers.settings import PICTURES
from facade_core.core.arrays import BoolArray, Float64Array, UInt8Array
from facade_core.core.errors import InputError

if TYPE_CHECKING:
    from pyproj import CRS, Transformer
    from rasterio.io import DatasetReader

# Suffixes of files with the georeference of a picture.
WORLD_FILE_SUFFIXES = frozenset({".wld", ".tfw", ".tifw", ".pgw", ".pngw", ".jgw", ".jpgw", ".jpegw", ".j2w", ".jp2w"})
_FALSE_OPACITY_NOTE = (
    "band {band} of {file} is stated as opacity but has values between, so it is not used; state infrared with "
    "gdal_edit.py -colorinterp_{band} undefined {file}"
)
_ASSUMED_WHITE_NOTE = (
    "white of {file} taken as {white:.0f}, as no value needs more bits; where it is another: "
    "gdal_translate -ot Byte -scale 0 WHITE 0 255 {file} OUT.tif"
)
_ASSUMED_BANDS_NOTE = (
    "bands 1, 2 and 3 of {file} taken for red, green and blue, as it states none; where they are others, state them with "
    "gdal_edit.py -colorinterp_1 red -colorinterp_2 green -colorinterp_3 blue"
)
REMEDY = "give a GeoTIFF, a mosaic of gdalbuildvrt, or a PNG or JPEG with its world file beside it"


@dataclass(frozen=True)
class Orthophoto:
    """Orthophoto on this machine.

    Attributes
    ----------
    path : file.
    crs : coordinate system of the file, WKT.
    frame : frame of the block, WKT.
    content : digest of the pixels and of their georeference.
    colours : numbers of the bands of red, green and blue, or one of grey or a palette.
    alpha : number of the band of opacity; None without one.
    white : value of white.
    """

    path: Path
    crs: str
    frame: str
    content: str
    colours: tuple[int, ...] = (1, 2, 3)
    alpha: int | None = None
    white: float = 255.0

    def digest_content(self) -> tuple[str, str, str]:
        """Return what tells the picture from others."""
        return self.content, self.crs, self.frame

    def covers(self, points: Float64Array) -> BoolArray:
        """Return a mask (n,) of the positions on the picture, transparent or not.

        Parameters
        ----------
        points : (n, 2) positions in the frame of the block, metres.
        """
        with _open_orthophoto(self.path) as raster:
            return _is_inside(raster, *_to_pixels(raster, _transformer(self.frame, self.crs), points))

    def sample(self, points: Float64Array, spacing: float) -> tuple[UInt8Array, BoolArray]:
        """Sample the colour at positions in the frame of the block.

        Bilinear interpolation between pixel centres, of means of pixels where these are finer than the spacing. Only the part
        around the positions is read.

        Parameters
        ----------
        points : (n, 2) positions, metres.
        spacing : distance between neighbouring positions, metres.

        Returns
        -------
        colour : (n, 3) RGB.
        known : (n,) False outside the picture and where it is transparent.

        Raises
        ------
        InputError
            Where that part of the file is broken.
        """
        colour, known = np.zeros((len(points), 3), np.uint8), np.zeros(len(points), bool)
        with _open_orthophoto(self.path) as raster:
            x, y = _to_pixels(raster, _transformer(self.frame, self.crs), points)
            near = _is_inside(raster, x, y)
            if not near.any():
                return colour, known
            x, y = x[near], y[near]
            rgb, alpha, (left, top, across, down) = self._read_around(
                raster, x, y, self._downsampling(raster, points, spacing)
            )
        colour[near], known[near] = _sample_bilinear(rgb, alpha, (x - left) / across - 0.5, (y - top) / down - 0.5)
        return colour, known

    def _downsampling(self, raster: DatasetReader, points: Float64Array, spacing: float) -> int:
        """Return the number of pixels per side that are averaged at a spacing in metres."""
        middle = points.mean(axis=0)
        ends = middle + np.array([[0.0, 0.0], [spacing, 0.0], [0.0, spacing]])
        x, y = _to_pixels(raster, _transformer(self.frame, self.crs), ends)
        steps = np.hypot(x[1:] - x[0], y[1:] - y[0])
        return max(1, int(steps.min())) if np.isfinite(steps).all() else 1

    def _read_around(
        self, raster: DatasetReader, x: Float64Array, y: Float64Array, downsampling: int
    ) -> tuple[UInt8Array, UInt8Array, tuple[float, float, float, float]]:
        """Return colour and alpha around pixel positions, with the left and upper edge and the pixel size."""
        left, top = max(int(x.min()) - downsampling, 0), max(int(y.min()) - downsampling, 0)
        right, bottom = (
            min(int(x.max()) + downsampling + 1, raster.width),
            min(int(y.max()) + downsampling + 1, raster.height),
        )
        if (right - left) * (bottom - top) > PICTURES.max_aerial_pixels_read:
            raise InputError(
                f"{raster.name} has {right - left} x {bottom - top} pixels where one surface lies; "
                "resample it to 1 cm, or coarser"
            )
        downsampling = max(
            downsampling, int(np.ceil(np.sqrt((right - left) * (bottom - top) / PICTURES.max_aerial_pixels_decoded)))
        )
        size = (max(1, (bottom - top) // downsampling), max(1, (right - left) // downsampling))
        rgb, alpha = self.read_box(raster, (left, top, right - left, bottom - top), size if downsampling > 1 else None)
        return rgb, alpha, (left, top, (right - left) / rgb.shape[1], (bottom - top) / rgb.shape[0])

    def read_box(
        self, raster: DatasetReader, box: tuple[int, int, int, int], size: tuple[int, int] | None
    ) -> tuple[UInt8Array, UInt8Array]:
        """Return colour (h, w, 3) and alpha (h, w) of a box (left, top, width, height), averaged to `size` (h, w)."""
        from rasterio.enums import ColorInterp, MaskFlags, Resampling
        from rasterio.windows import Window

        left, top, width, height = box
        width, height = min(width, raster.width - left), min(height, raster.height - top)
        options: dict[str, Any] = {"window": Window(left, top, width, height)}
        shape = size or (height, width)
        palette = ColorInterp.palette in raster.colorinterp
        how = Resampling.nearest if palette else Resampling.average
        colours = list(self.colours)
        if _is_of_bytes(raster):
            values = raster.read(colours, out_shape=(len(colours), *shape), resampling=how, **options)
        else:
            values = read_values(raster, colours, out_shape=(len(colours), *shape), resampling=how, **options)
            values = np.rint(255 * np.clip(np.nan_to_num(values) / self.white, 0, 1)).astype(np.uint8)
        options["resampling"] = Resampling.nearest
        if self.alpha is None and MaskFlags.alpha in raster.mask_flag_enums[colours[0] - 1]:
            alpha = np.full(shape, 255, np.uint8)  # the mask is a band that is no opacity
        elif self.alpha is None:
            alpha = raster.read_masks(colours, out_shape=(len(colours), *shape), **options).max(axis=0)
        else:
            opacity = raster.read(self.alpha, out_shape=shape, **options)
            alpha = np.where(opacity > _opaque_value(raster, self.alpha) / 2, 255, 0).astype(np.uint8)
        if is_inverted(raster):
            values = 255 - values
        if palette:
            table = np.zeros((256, 4), np.uint8)
            for index, colour in raster.colormap(colours[0]).items():
                table[index] = colour
            values = np.moveaxis(table[values[0]][..., :3], -1, 0)
        rgb = np.ascontiguousarray(np.moveaxis(np.broadcast_to(values, (3, *shape)), 0, -1))
        profile = _colour_profile(raster)
        return rgb if profile is None else profile.convert_array(rgb), alpha


def open_orthophoto(path: Path, crs: str | None, frame: CRS, places: Float64Array) -> Orthophoto:
    """Open an orthophoto, and check that it shows positions in the frame of the block.

    Parameters
    ----------
    path : file.
    crs : coordinate system of a file that states none or a wrong one.
    frame : frame of the block.
    places : (n, 2) positions, such as the corners of all buildings, metres.

    Raises
    ------
    InputError
        Where the file cannot be read, is not georeferenced, has values that are no colours, or shows none of the positions.
    """
    with _open_orthophoto(path) as raster:
        check_georeference(raster, path, REMEDY)
        raster_crs = read_raster_crs(raster, path, crs)
        if raster_crs is None:
            raise InputError(f"{path} states no frame; write imagery.aerial.crs: EPSG:...")
        x, y = _to_pixels(raster, _transformer(frame.to_wkt(), raster_crs.to_wkt()), places)
        inside = _is_inside(raster, x, y)
        if not inside.any():
            box = (*places.min(axis=0).tolist(), *places.max(axis=0).tolist())
            reason = coverage_message(raster, path, raster_crs, frame, box, "shows nothing of")
            raise InputError(f"{reason}, or mend imagery.aerial.crs")
        bands = find_colour_bands(raster, str(path))
        alpha = None if bands.alpha is None or not _is_opacity(raster, bands.alpha) else bands.alpha
        white = 255.0 if _is_of_bytes(raster) else _find_white(raster, path, bands.colours)
        wkt = raster_crs.to_wkt(), frame.to_wkt()
        photo = Orthophoto(path.absolute(), *wkt, _content_digest(raster), bands.colours, alpha, white)
        rows, columns = raster.block_shapes[0]
        blocks = np.unique(np.column_stack([y[inside] // rows, x[inside] // columns]).astype(np.int64), axis=0)
        for row, column in blocks.tolist():  # find broken blocks now, not at the first roof
            photo.read_box(raster, (column * columns, row * rows, columns, rows), (1, 1))
    return photo


def note_assumed_colours(photo: Orthophoto) -> tuple[str, ...]:
    """Return notes on bands and values whose meaning an orthophoto does not state."""
    with _open_orthophoto(photo.path) as raster:
        bands, name = find_colour_bands(raster, str(photo.path)), photo.path.name
        is_white_stated = _stated_bits(raster, photo.colours) is not None
    notes = [_ASSUMED_BANDS_NOTE.format(file=name)] if bands.is_assumed else []
    if bands.alpha != photo.alpha:
        notes.append(_FALSE_OPACITY_NOTE.format(file=name, band=bands.alpha))
    if not is_white_stated and photo.white not in (1.0, 255.0, 65535.0):
        notes.append(_ASSUMED_WHITE_NOTE.format(file=name, white=photo.white))
    return tuple(notes)


def _is_of_bytes(raster: DatasetReader) -> bool:
    return set(raster.dtypes) == {"uint8"}


def _find_white(raster: DatasetReader, path: Path, colours: tuple[int, ...]) -> float:
    """Return the value of white, by the stated bits, else by the values of an overview."""
    if (bits := _stated_bits(raster, colours)) is not None:
        return 2.0**bits - 1
    values = read_values(raster, colours, out_shape=(len(colours), *_overview_shape(raster)))
    return find_white(path, raster, values)


def _stated_bits(raster: DatasetReader, colours: tuple[int, ...]) -> int | None:
    stated = str(raster.tags(colours[0], ns="IMAGE_STRUCTURE").get("NBITS", ""))
    return int(stated) if stated.isdigit() and raster.scales[colours[0] - 1] == 1 else None


def _is_opacity(raster: DatasetReader, band: int) -> bool:
    """Return True where most values of a band are fully opaque or transparent."""
    values, most = raster.read(band, out_shape=_overview_shape(raster)), _opaque_value(raster, band)
    return bool(((values == 0) | (values >= most)).mean() >= PICTURES.min_opacity_share)


def _opaque_value(raster: DatasetReader, band: int) -> float:
    kind = np.dtype(raster.dtypes[band - 1])
    return float(np.iinfo(kind).max) if kind.kind in "iu" else 1.0


def _overview_shape(raster: DatasetReader) -> tuple[int, int]:
    return min(raster.height, PICTURES.overview_side_px), min(raster.width, PICTURES.overview_side_px)


def _content_digest(raster: DatasetReader) -> str:
    """Return the digest of the files with pixels, overviews and masks, and of the transform.

    Decoding all pixels of a city would take minutes.
    """
    digest = hashlib.sha256(repr(tuple(raster.transform)[:6]).encode())
    for path in map(Path, raster.files):
        if path.suffix.lower() not in WORLD_FILE_SUFFIXES:
            digest.update(f"{path.name.removeprefix(Path(raster.name).name)} {file_digest(path)}".encode())
    return digest.hexdigest()


@contextmanager
def _open_orthophoto(path: Path) -> Iterator[DatasetReader]:
    with open_raster(path, _find_driver(path, path.suffix.lower() == ".vrt"), "an orthophoto", REMEDY) as raster:
        yield raster


def _find_driver(path: Path, may_be_mosaic: bool = False) -> str:
    if driver := detect_driver(path, RASTER_DRIVERS):
        return driver
    if not may_be_mosaic:
        raise InputError(f"{path} is no orthophoto; {REMEDY}")
    check_virtual_raster(path, _find_driver)
    return "VRT"


def _transformer(frame: str, crs: str) -> Transformer:
    """Return a transformer for this thread, since transformers cannot be shared."""
    return _cached_transformer(frame, crs, threading.get_ident())


@lru_cache(maxsize=16)
def _cached_transformer(frame: str, crs: str, thread: int) -> Transformer:
    from pyproj import CRS, Transformer

    return Transformer.from_crs(CRS.from_wkt(frame), CRS.from_wkt(crs), always_xy=True)


def _to_pixels(
    raster: DatasetReader, transformer: Transformer, points: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Return positions (n, 2) as pixel coordinates, (n,) each; 0 is the left or upper edge, inf for none."""
    x, y = transformer.transform(points[:, 0], points[:, 1])
    back = ~raster.transform
    return back.a * x + back.b * y + back.c, back.d * x + back.e * y + back.f


def _is_inside(raster: DatasetReader, x: Float64Array, y: Float64Array) -> BoolArray:
    inside: BoolArray = (x >= 0) & (x < raster.width) & (y >= 0) & (y < raster.height)
    return inside


def _colour_profile(raster: DatasetReader) -> ColourProfile | None:
    try:
        content = base64.b64decode(str(raster.tags(ns="COLOR_PROFILE").get("SOURCE_ICC_PROFILE", "")))
    except ValueError:
        return None
    return profile_to_srgb(content, ("RGB",) if raster.count >= 3 else ("RGB", "L"))


def _sample_bilinear(
    rgb: UInt8Array, alpha: UInt8Array, x: Float64Array, y: Float64Array
) -> tuple[UInt8Array, BoolArray]:
    """Return colour (n, 3) of the opaque neighbours, and whether the nearest pixel is opaque.

    x, y : (n,) pixels from the centre of the first pixel.
    """
    height, width = alpha.shape
    x0, y0 = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    total, weight = np.zeros((len(x), 3)), np.zeros(len(x))
    for down in (0, 1):
        for across in (0, 1):
            row, column = np.clip(y0 + down, 0, height - 1), np.clip(x0 + across, 0, width - 1)
            share = (1 - np.abs(x - x0 - across)) * (1 - np.abs(y - y0 - down)) * (alpha[row, column] > 127)
            total += share[:, None] * rgb[row, column]
            weight += share
    nearest = alpha[np.clip(np.round(y).astype(int), 0, height - 1), np.clip(np.round(x).astype(int), 0, width - 1)]
    known = (nearest > 127) & (weight > 0)
    return np.round(total / np.maximum(weight, 1e-9)[:, None]).astype(np.uint8), known
