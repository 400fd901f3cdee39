"""Ground heights from a raster, such as a national elevation model, in the block's frame."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from catalogs.readers.pictures.rasters import PICTURES, check_place, driver_of, frame_of
from catalogs.readers.pictures.rasters import raster as opened_raster
from catalogs.readers.pictures.virtual_rasters import check_virtual
from facade_core.core.errors import InputError
from facade_core.core.types import Elevation

if TYPE_CHECKING:
    from pyproj import CRS

FINEST = 1.0  # m between cells; nothing on the ground that a facade shows is smaller
MOST_CELLS = 4_000_000
_MARGIN = 2  # cells around the block, so that heights are interpolated up to its border
_ON_EARTH = (-1000.0, 10_000.0)  # m; what lies outside marks unknown heights, declared or not
_METRES = {"ft": 0.3048, "foot": 0.3048, "feet": 0.3048, "us survey foot": 0.3048006096, "cm": 0.01, "dm": 0.1}
# Cells that are read, to be averaged, at most: 3.5 km at a quarter of a metre.
MOST_READ = 200_000_000
DEEPEST = 4  # virtual rasters of virtual rasters
REMEDY = "convert it to GeoTIFF"
_FORMATS = {magic: name for magic, name in PICTURES.items() if name != "JPEG"} | {
    b"EHFA_HEADER_TAG": "HFA",
    b"ncols": "AAIGrid",
    b"NCOLS": "AAIGrid",
    b"nrows": "AAIGrid",
    b"NROWS": "AAIGrid",
    b"UHL1": "DTED",
}
_NAMED = {".hgt": "SRTMHGT"}  # which begins with its heights


def read_elevation(path: Path, crs: CRS, bounds: tuple[float, float, float, float]) -> Elevation:
    """Ground heights of a raster's first band around (xmin, ymin, xmax, ymax) in the frame `crs`, in metres, NaN where unknown.

    path: a GeoTIFF, ESRI grid (.asc), Imagine (.img), JPEG 2000, PNG, DTED or SRTM .hgt, or a VRT that puts such files of its
    own folder together; only the part around the bounds is read. It is warped (bilinear) to square cells of the raster's own
    size, or larger ones where those would be finer than FINEST or more than MOST_CELLS. Raises InputError where the file is no
    raster, states no frame, has more than MOST_READ cells there or no height inside the bounds.
    """
    path = Path(path)
    if not (np.isfinite(bounds).all() and bounds[0] <= bounds[2] and bounds[1] <= bounds[3]):
        raise InputError(f"{path}: the block's bounds {bounds} are no box; repair its buildings' coordinates")
    with opened_raster(path, _driver(path), "a raster", REMEDY) as found:
        return _around(found, path, crs, bounds)


def _driver(path: Path, depth: int = 0) -> str:
    if not path.is_file():
        raise InputError(f"{path} is no file; give an elevation raster on this machine, such as a GeoTIFF")
    if driver := driver_of(path, _FORMATS) or _NAMED.get(path.suffix.lower()):
        return driver
    with path.open("rb") as file:
        start = file.read(256).lstrip(b"\xef\xbb\xbf \t\r\n")
    if start[:1] in (b"{", b"["):
        raise InputError(f"{path} is JSON, no raster; give e.g. a GeoTIFF")
    if start[:5].lower() in (b"ncols", b"nrows"):
        return "AAIGrid"
    if start[:1] != b"<":
        known = ", ".join(sorted({*_FORMATS.values(), *_NAMED.values()}))
        raise InputError(f"{path} cannot be read as a raster (it is none of {known}); {REMEDY}")
    if depth > DEEPEST:
        raise InputError(f"{path} is a virtual raster of virtual rasters {depth} times over; give one GeoTIFF")
    check_virtual(path, lambda source: _driver(source, depth + 1))
    return "VRT"


def _around(raster: Any, path: Path, crs: CRS, bounds: tuple[float, float, float, float]) -> Elevation:
    from pyproj import Transformer
    from rasterio import Affine
    from rasterio.enums import Resampling
    from rasterio.transform import from_origin, rowcol, xy
    from rasterio.warp import reproject
    from rasterio.windows import Window

    check_place(raster, path, "put its world file beside it, or give a GeoTIFF")
    raster_crs = frame_of(raster, path)
    if raster_crs is None:
        raise InputError(
            f"{path} states no frame; put its .prj beside it, or write it in with gdal_translate -a_srs EPSG:n"
        )
    if raster.dtypes[0].startswith("complex"):
        raise InputError(f"{path} has complex numbers for heights; give their real part as a GeoTIFF")
    to_own = Transformer.from_crs(crs, raster_crs, always_xy=True)

    x, y = np.meshgrid(np.linspace(bounds[0], bounds[2], 21), np.linspace(bounds[1], bounds[3], 21))
    rows, columns = rowcol(raster.transform, *to_own.transform(x.ravel(), y.ravel()), op=np.asarray)
    if not (np.isfinite(columns).all() and np.isfinite(rows).all()) or not _overlap(columns, rows, raster):
        raise InputError(_beside(raster, path, raster_crs, crs, bounds))
    row, column = math.floor(float(np.median(rows))), math.floor(float(np.median(columns)))
    across, along = xy(raster.transform, [row, row, row + 1], [column, column + 1, column])
    cells = np.column_stack(to_own.transform(across, along, direction="INVERSE"))
    native = float(np.linalg.norm(cells[1:] - cells[0], axis=1).min())
    if not 1e-4 <= native < math.inf:
        raise InputError(f"{path} has cells of {native:g} m; resample it to {FINEST:g} m with gdalwarp -tr")
    step = max(FINEST, round(native, 6))
    while True:
        # Cell centres on the raster's own where the frames agree: heights are then taken over as they are.
        first = np.floor((np.array([bounds[0], bounds[1]]) - cells[0]) / step).astype(int) - _MARGIN
        last = np.ceil((np.array([bounds[2], bounds[3]]) - cells[0]) / step).astype(int) + _MARGIN
        width, height = (last - first + 1).tolist()
        if width * height <= MOST_CELLS:
            break
        step *= 1.05

    spare = 2 + 2 * _MARGIN * step / native
    left, right = np.clip([columns.min() - spare, columns.max() + spare], 0, raster.width)
    top, bottom = np.clip([rows.min() - spare, rows.max() + spare], 0, raster.height)
    window = Window(int(left), int(top), math.ceil(right) - int(left), math.ceil(bottom) - int(top))
    coarser = max(1.0, step / native)
    overview = max((factor for factor in raster.overviews(1) if factor <= coarser), default=1)
    if window.width * window.height / overview**2 > MOST_READ:
        raise InputError(
            f"{path} has {window.width} x {window.height} cells of {native:.3g} m around the block; resample it with "
            f"gdalwarp -tr {FINEST:g} {FINEST:g}"
        )
    shape = max(1, round(window.height / coarser)), max(1, round(window.width / coarser))
    found = raster.read(1, window=window, out_shape=shape, masked=True, resampling=Resampling.average)
    source = np.ma.filled(found.astype(np.float32), np.nan)
    unit = _METRES.get((raster.units[0] or "").lower(), 1.0)
    source = (source * np.float32(raster.scales[0]) + np.float32(raster.offsets[0])) * np.float32(unit)
    with np.errstate(invalid="ignore"):
        source[~((source > _ON_EARTH[0]) & (source < _ON_EARTH[1]))] = np.nan

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
    inner = heights[_MARGIN : height - _MARGIN, _MARGIN : width - _MARGIN]
    if not np.isfinite(inner).any():
        raise InputError(_beside(raster, path, raster_crs, crs, bounds, "has no known height inside"))
    return Elevation(float(west), float(north), step, heights)


def _overlap(columns: np.ndarray, rows: np.ndarray, raster: Any) -> bool:
    return bool(columns.max() > 0 and rows.max() > 0 and columns.min() < raster.width and rows.min() < raster.height)


def _beside(
    raster: Any,
    path: Path,
    raster_crs: CRS,
    crs: CRS,
    bounds: tuple[float, float, float, float],
    problem: str = "does not cover",
) -> str:
    """What to say of a raster of another place: in the block's frame what it covers and what is needed."""
    from pyproj import Transformer

    covered = Transformer.from_crs(raster_crs, crs, always_xy=True).transform_bounds(*raster.bounds)
    frame = crs.to_string() if np.isfinite(covered).all() else raster_crs.to_string()
    covered = covered if np.isfinite(covered).all() else tuple(raster.bounds)
    spans = [", ".join(f"{value:.7g}" for value in box) for box in (bounds, covered)]
    return (
        f"{path} {problem} the block [{spans[0]}]; it spans [{spans[1]}] in {frame}; give a raster of the block's place"
    )
