"""Ground heights of a raster, such as a national elevation model, in the frame of a block."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
from pyproj import CRS, Transformer
from rasterio import Affine
from rasterio.enums import Resampling
from rasterio.errors import RasterioError
from rasterio.io import DatasetReader
from rasterio.transform import from_origin, rowcol, xy
from rasterio.warp import reproject
from rasterio.windows import Window

from catalogs.crs import metres_per_height_unit
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
from facade_core.core.arrays import Float32Array, Float64Array, IntArray
from facade_core.core.errors import InputError
from facade_core.core.regular_files import open_regular
from facade_core.core.types import ElevationRaster

# Units of a band by the words of their names; of other names they are metres.
_METRES_BY_UNIT_WORD = {
    re.compile(r"\b(?:us|survey)\b.*\b(?:ft|foot|feet)\b|\b(?:ft|foot|feet)\b.*\b(?:us|survey)\b|ftus|usft"): 1200
    / 3937,
    re.compile(r"\b(?:ft|foot|feet)\b"): 0.3048,
    re.compile(r"\bmm\b|millimet"): 0.001,
    re.compile(r"\bcm\b|centimet"): 0.01,
    re.compile(r"\bdm\b|decimet"): 0.1,
}
_HEIGHT_WORDS = re.compile(r"elevation|height|\b(?:dem|dtm|dsm|dgm)\b", re.IGNORECASE)
REMEDY = "convert it to GeoTIFF, a raster with gdal_translate IN OUT.tif, points with PDAL (writers.gdal)"
_DRIVERS_BY_MAGIC = {magic: name for magic, name in RASTER_DRIVERS.items() if name != "JPEG"} | {
    b"EHFA_HEADER_TAG": "HFA",
    b"ncols": "AAIGrid",
    b"NCOLS": "AAIGrid",
    b"nrows": "AAIGrid",
    b"NROWS": "AAIGrid",
    b"UHL1": "DTED",
}
_DRIVERS_BY_SUFFIX = {".hgt": "SRTMHGT"}  # no magic bytes


def read_elevation(path: Path, crs: CRS, bounds: tuple[float, float, float, float]) -> ElevationRaster:
    """Read ground heights around the bounds of a block, in metres, NaN where unknown.

    The first band is warped bilinearly to square cells of the size of the raster's cells, coarser where these are finer than
    PICTURES.min_elevation_cell_m or would be more than PICTURES.max_elevation_cells. Only the part around the bounds is read.

    Parameters
    ----------
    path : GeoTIFF, ESRI grid (.asc), Imagine (.img), JPEG 2000, PNG, DTED, SRTM .hgt, or a VRT of such files in its folder.
    crs : frame of the block.
    bounds : (xmin, ymin, xmax, ymax) in the frame, metres.

    Raises
    ------
    InputError
        Where the file is no raster, states no coordinate system, has too many cells there, has no
        height inside the bounds, or is too steep for heights in metres.
    """
    path = Path(path)
    if not (np.isfinite(bounds).all() and bounds[0] <= bounds[2] and bounds[1] <= bounds[3]):
        raise InputError(f"{path}: the block's bounds {bounds} are no box; repair its buildings' coordinates")
    with open_raster(path, _find_driver(path), "a raster", REMEDY) as found:
        return _read_around(found, path, crs, bounds)


def _find_driver(path: Path, depth: int = 0) -> str:
    if not path.is_file():
        raise InputError(f"{path} is no file; give an elevation raster on this machine, such as a GeoTIFF")
    if driver := detect_driver(path, _DRIVERS_BY_MAGIC) or _DRIVERS_BY_SUFFIX.get(path.suffix.lower()):
        return driver
    with open_regular(path) as file:
        start = file.read(256).lstrip(b"\xef\xbb\xbf \t\r\n")
    if start[:1] in (b"{", b"["):
        raise InputError(f"{path} is JSON, no raster; give e.g. a GeoTIFF")
    if start[:5].lower() in (b"ncols", b"nrows"):
        return "AAIGrid"
    if start[:1] != b"<":
        known = ", ".join(sorted({*_DRIVERS_BY_MAGIC.values(), *_DRIVERS_BY_SUFFIX.values()}))
        raise InputError(f"{path} cannot be read as a raster (it is none of {known}); {REMEDY}")
    if depth > PICTURES.max_vrt_depth:
        raise InputError(f"{path} is a virtual raster of virtual rasters {depth} times over; give one GeoTIFF")
    check_virtual_raster(path, lambda source: _find_driver(source, depth + 1))
    return "VRT"


def _read_around(
    raster: DatasetReader, path: Path, crs: CRS, bounds: tuple[float, float, float, float]
) -> ElevationRaster:

    check_georeference(raster, path, "put its world file beside it, or give a GeoTIFF")
    raster_crs = read_raster_crs(raster, path)
    if raster_crs is None:
        raise InputError(
            f"{path} states no frame; put its .prj beside it, or write it in with gdal_translate -a_srs EPSG:n"
        )
    _check_bands(raster, path)
    to_own = Transformer.from_crs(crs, raster_crs, always_xy=True)

    x, y = np.meshgrid(np.linspace(bounds[0], bounds[2], 21), np.linspace(bounds[1], bounds[3], 21))
    rows, columns = rowcol(raster.transform, *to_own.transform(x.ravel(), y.ravel()), op=np.asarray)
    if not (np.isfinite(columns).all() and np.isfinite(rows).all()) or not _overlaps(columns, rows, raster):
        raise InputError(coverage_message(raster, path, raster_crs, crs, bounds))
    row, column = math.floor(float(np.median(rows))), math.floor(float(np.median(columns)))
    across, along = xy(raster.transform, [row, row, row + 1], [column, column + 1, column])
    cells = np.column_stack(to_own.transform(across, along, direction="INVERSE"))
    native = float(np.linalg.norm(cells[1:] - cells[0], axis=1).min())
    if not 1e-4 <= native < math.inf:
        raise InputError(
            f"{path} has cells of {native:g} m; resample it to {PICTURES.min_elevation_cell_m:g} m with gdalwarp -tr"
        )
    step, first, last = _choose_grid(bounds, cells[0], native)
    width, height = (last - first + 1).tolist()
    margin = PICTURES.elevation_margin_cells

    spare = 2 + 2 * margin * step / native
    left, right = np.clip([columns.min() - spare, columns.max() + spare], 0, raster.width)
    top, bottom = np.clip([rows.min() - spare, rows.max() + spare], 0, raster.height)
    window = Window(int(left), int(top), math.ceil(right) - int(left), math.ceil(bottom) - int(top))
    coarser = max(1.0, step / native)
    overview = max((factor for factor in raster.overviews(1) if factor <= coarser), default=1)
    if window.width * window.height / overview**2 > PICTURES.max_elevation_cells_read:
        raise InputError(
            f"{path} has {window.width} x {window.height} cells of {native:.3g} m around the block; resample it with "
            f"gdalwarp -tr {PICTURES.min_elevation_cell_m:g} {PICTURES.min_elevation_cell_m:g}"
        )
    shape = max(1, round(window.height / coarser)), max(1, round(window.width / coarser))
    source = _read_heights(raster, path, raster_crs, window, shape)
    west, north = cells[0] + (first[0] * step, last[1] * step)
    heights = np.full((height, width), np.nan, np.float32)
    cell = raster.window_transform(window)
    wider, higher = window.width / shape[1], window.height / shape[0]
    reproject(
        source,
        heights,
        src_transform=Affine(cell.a * wider, cell.b * higher, cell.c, cell.d * wider, cell.e * higher, cell.f),
        src_crs=raster_crs.to_wkt(),
        src_nodata=np.nan,
        dst_transform=from_origin(west - step / 2, north + step / 2, step, step),
        dst_crs=crs.to_wkt(),
        dst_nodata=np.nan,
        resampling=Resampling.bilinear,
    )
    if not np.isfinite(heights[margin : height - margin, margin : width - margin]).any():
        raise InputError(coverage_message(raster, path, raster_crs, crs, bounds, "has no known height inside"))
    _check_slope(heights, step, path)
    return ElevationRaster(float(west), float(north), step, heights)


def _choose_grid(
    bounds: tuple[float, float, float, float], origin: Float64Array, native: float
) -> tuple[float, IntArray, IntArray]:
    """Return the side of the cells around bounds, metres, and the first and last column and row from an origin."""
    step = max(PICTURES.min_elevation_cell_m, round(native, 6))
    while True:
        # Cell centres coincide with those of the raster in the same CRS, so that heights stay exact.
        first = np.floor((np.array(bounds[:2]) - origin) / step).astype(int) - PICTURES.elevation_margin_cells
        last = np.ceil((np.array(bounds[2:]) - origin) / step).astype(int) + PICTURES.elevation_margin_cells
        if math.prod((last - first + 1).tolist()) <= PICTURES.max_elevation_cells:
            return step, first, last
        step *= 1.05


def _check_bands(raster: DatasetReader, path: Path) -> None:
    if raster.count >= 3 and set(raster.dtypes[:3]) == {"uint8"}:
        raise InputError(
            f"{path} has {raster.count} bands of 8 bits, which is a picture; give heights in metres in one band"
        )
    described = [bool(_HEIGHT_WORDS.search(text or "")) for text in raster.descriptions]
    if any(described[1:]) and not described[0]:
        raise InputError(
            f"{path} has its heights in band {1 + described.index(True)}; "
            f"write them alone with gdal_translate -b {1 + described.index(True)} {path.name} OUT.tif"
        )
    if raster.dtypes[0].startswith("complex"):
        raise InputError(f"{path} has complex numbers for heights; give their real part as a GeoTIFF")


def _read_heights(raster: DatasetReader, path: Path, crs: CRS, window: Window, shape: tuple[int, int]) -> Float32Array:
    """Return the heights of a window in metres, averaged to a shape (rows, columns), NaN where unknown."""
    try:
        found = raster.read(1, window=window, out_shape=shape, masked=True, resampling=Resampling.average)
    except RasterioError as error:
        place = _find_damaged_place(raster, window)
        if place is None:
            raise
        raise InputError(
            f"{path} has damaged cells around {place} ({crs.to_string()[:60]}), in the surroundings of the block; "
            "fetch the file again, or cut that place out with gdal_translate -projwin"
        ) from error
    unit = _height_unit(raster, crs)
    with np.errstate(invalid="ignore", over="ignore"):  # values out of range become unknown
        source = np.ma.filled(found.astype(np.float32), np.nan)
        source = (source * np.float32(raster.scales[0]) + np.float32(raster.offsets[0])) * np.float32(unit)
        source[~((source > PICTURES.elevation_range_m[0]) & (source < PICTURES.elevation_range_m[1]))] = np.nan
    return np.asarray(source)


def _height_unit(raster: DatasetReader, crs: CRS) -> float:
    """Return the metres per unit of heights: the stated unit of the band, else that of its frame."""
    stated = _stated_unit(raster)
    if not stated:
        return metres_per_height_unit(raster.crs.to_wkt() if raster.crs else crs)
    return next((metres for words, metres in _METRES_BY_UNIT_WORD.items() if words.search(stated)), 1.0)


def _stated_unit(raster: DatasetReader) -> str:
    return re.sub(r"[\s_.()-]+", " ", raster.units[0] or "").strip().lower()


def note_assumed_unit(path: Path) -> tuple[str, ...]:
    """Return a note where the heights of a raster are taken in the unit of its frame, which is not the metre.

    Raises
    ------
    InputError
        Where the file is no raster.
    """
    with open_raster(path, _find_driver(path), "a raster", REMEDY) as raster:
        crs = read_raster_crs(raster, path)
        if crs is None or _stated_unit(raster) or (raster.crs and CRS.from_wkt(raster.crs.to_wkt()).is_compound):
            return ()
        unit = _height_unit(raster, crs)
    if unit == 1.0:
        return ()
    return (
        f"heights of {path.name} taken in the unit of its frame ({unit:.4f} m), as none is stated; where they are metres, "
        f"state it with gdal_edit.py -units metre {path.name}",
    )


def _check_slope(heights: Float32Array, step: float, path: Path) -> None:
    """Raise where most of the ground is too steep, which tells heights in a smaller unit that is not stated."""
    if min(heights.shape) < 2:
        return
    slopes = np.hypot(*np.gradient(heights, step))
    slopes = slopes[np.isfinite(slopes)]
    if len(slopes) and (median := float(np.median(slopes))) > PICTURES.max_median_slope:
        raise InputError(
            f"{path}: half of its cells rise more than {median:.2g} m a metre, so its heights cannot be metres; state "
            "their unit, e.g. gdal_translate -a_scale 0.01 for centimetres"
        )


def _find_damaged_place(raster: DatasetReader, window: Window) -> str | None:
    """Return the middle "x, y" of the first stored block of a window that cannot be read; None where each can."""
    rows, columns = raster.block_shapes[0]
    for row in range(window.row_off // rows * rows, window.row_off + window.height, rows):
        for column in range(window.col_off // columns * columns, window.col_off + window.width, columns):
            block = Window(column, row, min(columns, raster.width - column), min(rows, raster.height - row))
            try:
                raster.read(1, window=block)
            except RasterioError:
                x, y = raster.transform * (column + block.width / 2, row + block.height / 2)
                return f"{x:.7g}, {y:.7g}"
    return None


def _overlaps(columns: Float64Array, rows: Float64Array, raster: DatasetReader) -> bool:
    return bool(columns.max() > 0 and rows.max() > 0 and columns.min() < raster.width and rows.min() < raster.height)
