"""Checks of GDAL virtual rasters (VRT): only mosaics of files in the same folder are accepted."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from xml.etree.ElementTree import Element

from catalogs.reader_errors import wrap_reader_errors
from catalogs.readers.gdal_files import check_siblings
from catalogs.readers.pictures.rasters import check_sidecar
from catalogs.readers.settings import PICTURES
from facade_core.core.errors import InputError
from facade_core.core.regular_files import read_regular

REMEDY = "give one GeoTIFF (gdal_translate)"
# Elements of mosaics of gdalbuildvrt and gdal_translate. Other elements read any file as raw numbers, warp, compute, or open
# sources with options.
_ALLOWED_ELEMENTS = {
    "VRTDataset", "SRS", "GeoTransform", "Metadata", "MDI", "VRTRasterBand", "NoDataValue", "ColorInterp", "Description",
    "UnitType", "Scale", "Offset", "SimpleSource", "ComplexSource", "SourceFilename", "SourceBand", "SourceProperties",
    "SrcRect", "DstRect", "NODATA", "ScaleOffset", "ScaleRatio", "HideNoDataValue", "Histograms", "OverviewList",
    "BlockXSize", "BlockYSize",
}  # fmt: skip


def check_virtual_raster(path: Path, check_source: Callable[[Path], object]) -> None:
    """Raise InputError unless a file is a virtual raster of files in its folder or below.

    Parameters
    ----------
    path : VRT file.
    check_source : called with each source file.
    """
    for element in _parse_virtual_raster(path).iter():
        if element.tag not in _ALLOWED_ELEMENTS:
            raise InputError(f"{path} is more than a mosaic of files ({str(element.tag)[:60]}); {REMEDY}")
        named = {name.lower(): value for name, value in element.attrib.items()}
        if "subclass" in named or "OVERVIEW_FILE" in map(str.upper, named.values()):
            raise InputError(f"{path} is more than a mosaic of files ({', '.join(named.values())[:60]}); {REMEDY}")
        if element.tag == "SourceFilename":
            _check_source(path, (element.text or "").strip(), named.get("relativetovrt") == "1", check_source)


def _parse_virtual_raster(path: Path) -> Element:
    from defusedxml import ElementTree

    if path.stat().st_size > PICTURES.max_vrt_bytes:
        raise InputError(
            f"{path} is XML of more than {PICTURES.max_vrt_bytes // 1_000_000} MB, no raster; give e.g. a GeoTIFF"
        )
    with wrap_reader_errors(path, "is no raster, nor XML of one", "give e.g. a GeoTIFF"):
        root: Element = ElementTree.fromstring(read_regular(path, PICTURES.max_vrt_bytes), forbid_dtd=True)
    if root.tag != "VRTDataset":
        raise InputError(f"{path} is XML ({str(root.tag)[:60]}), no raster; give e.g. a GeoTIFF")
    return root


def _check_source(path: Path, text: str, relative: bool, check_source: Callable[[Path], object]) -> None:
    folder = path.parent.resolve()
    try:
        source = (folder / text if relative else Path(text)).resolve()
        found = source.is_file()
    except (OSError, RuntimeError, ValueError):  # not a path
        found = False
    if not found:
        raise InputError(f"{path} is put together from {text[:200]}, which is no file here; {REMEDY}")
    if not source.is_relative_to(folder):
        raise InputError(f"{path} is put together from {text[:200]}, which lies outside its folder; {REMEDY}")
    check_siblings(source)
    check_sidecar(source)
    check_source(source)
