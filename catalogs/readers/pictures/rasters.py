"""Opening of rasters: driver by the first bytes, georeference checks, no access to other files or addresses."""

from __future__ import annotations

import logging
import math
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catalogs.crs import has_east_north_axes, parse_crs
from catalogs.reader_errors import to_single_line, wrap_reader_errors
from catalogs.readers.gdal_files import open_raster_dataset
from catalogs.readers.settings import PICTURES
from facade_core.core.errors import InputError
from facade_core.core.regular_files import open_regular

if TYPE_CHECKING:
    from pyproj import CRS
    from rasterio.io import DatasetReader

log = logging.getLogger(__name__)

# GDAL drivers of self-contained formats by their first bytes.
RASTER_DRIVERS: Mapping[bytes, str] = {
    b"II*\0": "GTiff",
    b"MM\0*": "GTiff",
    b"II+\0": "GTiff",
    b"MM\0+": "GTiff",
    b"\x89PNG": "PNG",
    b"\xff\xd8\xff": "JPEG",
    b"\0\0\0\x0cjP": "JP2OpenJPEG",
}


def detect_driver(path: Path, drivers: Mapping[bytes, str]) -> str | None:
    """Return GDAL's driver of a file by its first bytes; None where it is none of `drivers`."""
    with open_regular(path) as file:
        start = file.read(32)
    return next((name for magic, name in drivers.items() if start.startswith(magic)), None)


@contextmanager
def open_raster(path: Path, driver: str, kind: str, remedy: str) -> Iterator[DatasetReader]:
    """Open a raster with a driver.

    Parameters
    ----------
    path : file.
    driver : GDAL driver.
    kind : text such as "a raster" for messages.
    remedy : advice at the end of messages.

    Raises
    ------
    InputError
        Where the raster cannot be read, on opening or later.
    """
    from rasterio.errors import RasterioError

    check_sidecar(path)
    with wrap_reader_errors(path, f"is not a valid {kind.partition(' ')[2]}", remedy):
        try:
            options = {"GDAL_CACHEMAX": PICTURES.gdal_cache_bytes}
            with _silence_unraisable(), open_raster_dataset(path, driver, options) as opened:
                _check_size(opened, path)
                yield opened
        except RasterioError as error:
            reason = to_single_line(str(error.__cause__ or error))[:160]
            raise InputError(f"{path} cannot be read as {kind} ({reason}); {remedy}") from error


@contextmanager
def _silence_unraisable() -> Iterator[None]:
    """Log errors of rasterio's log callback instead of printing them.

    GDAL quotes bytes of a broken file, and rasterio fails to decode them as text.
    """
    before, sys.unraisablehook = sys.unraisablehook, lambda error: log.debug("%s: %s", error.object, error.exc_value)
    try:
        yield
    finally:
        sys.unraisablehook = before


def check_georeference(raster: DatasetReader, path: Path, remedy: str) -> None:
    """Raise InputError where the cells of a raster are no parallelograms on the ground.

    Parameters
    ----------
    raster : open raster.
    path : file, for messages.
    remedy : advice for a raster without a georeference.
    """
    cell = raster.transform
    if cell.is_identity:
        stated = "control points only; warp it with gdalwarp" if raster.gcps[0] else f"no place on the ground; {remedy}"
        raise InputError(f"{path} states {stated}")
    sides = math.hypot(cell.a, cell.d), math.hypot(cell.b, cell.e)
    sound = all(PICTURES.min_cell_side <= side <= PICTURES.max_cell_side for side in sides) and math.isfinite(
        cell.c + cell.f
    )
    if not (sound and abs(cell.a * cell.e - cell.b * cell.d) > 0.01 * sides[0] * sides[1]):
        shown = ", ".join(f"{value:g}" for value in (cell.a, cell.b, cell.d, cell.e))
        raise InputError(
            f"{path} has cells without an area or beyond the Earth ({shown}); export it again with its place"
        )


def read_raster_crs(raster: DatasetReader, path: Path, crs: str | None = None) -> CRS | None:
    """Return the given horizontal coordinate system, or that of a raster, or None.

    Parameters
    ----------
    raster : open raster.
    path : file, for messages.
    crs : coordinate system that replaces that of the raster.

    Raises
    ------
    InputError
        For an unknown system, or one with axes other than east and north.
    """
    text = crs or (raster.crs.to_wkt() if raster.crs else _read_projection_file(path))
    if not text:
        return None
    try:
        frame = parse_crs(text)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    if not has_east_north_axes(frame):
        raise InputError(
            f"{path} is in {frame.name}, whose axes are not east and north; warp it with gdalwarp -t_srs EPSG:n"
        )
    return frame


def _read_projection_file(path: Path) -> str | None:
    """Return the text of a raster's .prj file, because GDAL reads only its older forms; None without the file."""
    beside = path.with_suffix(".prj")
    if not beside.is_file():
        return None
    with open_regular(beside) as file:
        return file.read(PICTURES.max_projection_bytes).decode(errors="replace").strip() or None


def _check_size(raster: DatasetReader, path: Path) -> None:
    if (
        raster.driver == "AAIGrid" and _count_words(path) < raster.width * raster.height
    ):  # GDAL looks for the others without end
        raise InputError(f"{path} states {raster.width} x {raster.height} cells and holds fewer; export it again")
    rows, columns = raster.block_shapes[0]
    together = raster.count if raster.count > 1 and str(raster.interleaving or "").lower().endswith("pixel") else 1
    across = math.ceil(min(raster.width, PICTURES.max_row_cells) / columns)
    if rows * columns * across * together * max(map(_value_bytes, raster.dtypes)) > PICTURES.gdal_cache_bytes:
        raise InputError(
            f"{path} is stored in blocks of {columns} x {rows} cells; rewrite it with gdal_translate -co TILED=YES"
        )


def _count_words(path: Path) -> int:
    """Return the number of words of a text, read in pieces; 0 for binary data, in which GDAL finds no end."""
    total, within = 0, np.zeros(1, bool)
    with open_regular(path) as file:
        while piece := file.read(1_000_000):
            if b"\0" in piece:
                return 0
            inked = np.concatenate([within, np.frombuffer(piece, np.uint8) > ord(" ")])
            total += int((inked[1:] & ~inked[:-1]).sum())
            within = inked[-1:]
    return total


def _value_bytes(kind: str) -> int:

    try:
        return np.dtype(kind).itemsize
    except TypeError:  # a complex type of GDAL
        return 16


def check_sidecar(path: Path) -> None:
    """Raise InputError where FILE.aux.xml makes GDAL read another file in place of a raster."""
    beside = path.with_name(path.name + ".aux.xml")
    if beside.is_file():
        with open_regular(beside) as file:
            content = file.read(10_000_001)
        if b"OVERVIEW_FILE" in content.upper() or len(content) > 10_000_000:
            raise InputError(f"{beside} names another file for overviews; remove it")


def coverage_message(
    raster: DatasetReader,
    path: Path,
    raster_crs: CRS,
    crs: CRS,
    bounds: tuple[float, float, float, float],
    problem: str = "does not cover",
) -> str:
    """Return the message for a raster of another place: its extent and that of the block, in the frame of the block."""
    from pyproj import Transformer

    covered = Transformer.from_crs(raster_crs, crs, always_xy=True).transform_bounds(*raster.bounds)
    frame = crs.to_string() if np.isfinite(covered).all() else raster_crs.to_string()
    covered = covered if np.isfinite(covered).all() else tuple(raster.bounds)
    spans = [", ".join(f"{value:.7g}" for value in box) for box in (bounds, covered)]
    return (
        f"{path} {problem} the block [{spans[0]}]; it spans [{spans[1]}] in {frame}; give a raster of the block's place"
    )
