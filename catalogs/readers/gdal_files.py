"""The only door to GDAL for files of a user.

GDAL detects formats by content, some formats name other files and addresses, and some are programs. So a file is opened
only where it is a regular file of a known format, its siblings are regular files, a GeoPackage holds tables alone, and
no address can be reached.
"""

from __future__ import annotations

import logging
import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from catalogs.gdal_paths import gdal_read_path
from catalogs.readers.geopackage_tables import check_geopackage_tables
from facade_core.core.errors import InputError
from facade_core.core.regular_files import open_regular

if TYPE_CHECKING:
    import pyarrow as pa
    from geopandas import GeoDataFrame
    from rasterio.io import DatasetReader

# What GDAL warns of is off the terminal of every process; readers check what they need.
for _library in ("rasterio", "pyogrio"):
    logging.getLogger(_library).addHandler(logging.NullHandler())
    logging.getLogger(_library).propagate = False
# Nothing answers at this proxy, so that no address can be reached.
OFFLINE_OPTIONS: Mapping[str, str] = {
    "GDAL_HTTP_PROXY": "http://127.0.0.1:9",
    "GDAL_HTTP_MAX_RETRY": "0",
    "GDAL_HTTP_CONNECTTIMEOUT": "1",
    "CPL_VSIL_CURL_ALLOWED_EXTENSIONS": ".none",
}
# First bytes and GDAL drivers of vector files by suffix.
_JSON_DRIVERS = ("GeoJSON", "GeoJSONSeq", "ESRIJSON", "TopoJSON", "JSONFG")
_VECTOR_FORMATS: Mapping[str, tuple[tuple[bytes, ...], tuple[str, ...]]] = {
    ".gpkg": ((b"SQLite format 3",), ("GPKG",)),
    ".fgb": ((b"fgb",), ("FlatGeobuf",)),
    ".shp": ((b"\x00\x00\x27\x0a",), ("ESRI Shapefile",)),
    ".geojson": ((b"{", b"\x1e"), _JSON_DRIVERS),
    ".json": ((b"{", b"\x1e"), _JSON_DRIVERS),
    ".geojsonl": ((b"{", b"\x1e"), _JSON_DRIVERS),
    ".parquet": ((b"PAR1",), ()),
    ".geoparquet": ((b"PAR1",), ()),
}


def check_vector_file(path: Path) -> None:
    """Raise InputError unless a vector file is a regular file of the format of its suffix, beside regular files.

    A GeoPackage must hold tables, without views and generated columns.
    """
    magic, _ = _find_format(path)
    try:
        with open_regular(path) as file:
            start = file.read(64).removeprefix(b"\xef\xbb\xbf").lstrip(b" \t\r\n")
    except OSError as error:
        raise InputError(f"{path} cannot be opened ({error.strerror}); check the path") from error
    if not start.startswith(magic):
        raise InputError(f"{path} is no {path.suffix} file by its content; export it again, e.g. as GeoPackage")
    check_siblings(path)
    if path.suffix.lower() == ".gpkg":
        check_geopackage_tables(path)


def list_layers(path: Path) -> list[tuple[str, str | None]]:
    """Return the name of each layer of a vector file and the type of its geometry, None without one."""
    import pyogrio

    opened, options = _check_and_name(path)
    if path.suffix.lower() == ".gpkg":  # GDAL would also list views, and evaluate them
        names = check_geopackage_tables(path)
        found = [(name, pyogrio.read_info(opened, layer=name, **options)["geometry_type"]) for name in names]
    else:
        found = pyogrio.list_layers(opened).tolist()
    return [(str(name), None if geometry is None else str(geometry)) for name, geometry in found]


def read_info(path: Path, layer: str, **options: object) -> dict[str, Any]:
    """Return `pyogrio.read_info` of a layer of a checked file."""
    import pyogrio

    opened, fixed = _check_and_name(path)
    info: dict[str, Any] = pyogrio.read_info(opened, layer=layer, **fixed, **options)
    return info


def read_dataframe(path: Path, layer: str, **options: object) -> GeoDataFrame:
    """Return `pyogrio.read_dataframe` of a layer of a checked file."""
    import pyogrio

    opened, fixed = _check_and_name(path)
    return pyogrio.read_dataframe(opened, layer=layer, **fixed, **options)


def read_arrow(path: Path, layer: str, **options: object) -> tuple[dict[str, Any], pa.Table]:
    """Return `pyogrio.read_arrow` of a layer of a checked file."""
    import pyogrio

    opened, fixed = _check_and_name(path)
    found: tuple[dict[str, Any], pa.Table] = pyogrio.read_arrow(opened, layer=layer, **fixed, **options)
    return found


def read_raw(path: Path, layer: str, **options: object) -> tuple[Any, ...]:
    """Return `pyogrio.raw.read` of a layer of a checked file."""
    import pyogrio

    opened, fixed = _check_and_name(path)
    found: tuple[Any, ...] = pyogrio.raw.read(opened, layer=layer, **fixed, **options)
    return found


@contextmanager
def open_raster_dataset(path: Path, driver: str, options: Mapping[str, str | int]) -> Iterator[DatasetReader]:
    """Open a raster with a driver, without access to addresses.

    Parameters
    ----------
    path : file.
    driver : GDAL driver.
    options : further options of GDAL.
    """
    import rasterio

    with open_regular(path):
        check_siblings(path)
    environment = rasterio.Env(**OFFLINE_OPTIONS, **options)
    with warnings.catch_warnings(), environment:
        warnings.simplefilter("ignore")  # readers check what they warn of
        with rasterio.open(path.absolute(), driver=driver, sharing=False) as opened:
            yield opened


def check_siblings(path: Path) -> None:
    """Raise InputError where a file that GDAL may open beside a file is a pipe or a device.

    These are files of its name or stem and a suffix, such as NAME.aux.xml, NAME-wal or STEM.prj.
    """
    beside = re.compile(rf"{re.escape(path.stem)}(?![^\W_])", re.IGNORECASE)
    for sibling in path.absolute().parent.iterdir():
        if beside.match(sibling.name) and sibling.exists() and not (sibling.is_file() or sibling.is_dir()):
            raise InputError(f"{path}: {sibling.name} beside it is a pipe, a socket or a device; remove it")


def _check_and_name(path: Path) -> tuple[str, dict[str, str]]:
    """Return the path of a checked file for GDAL and the options to open it, with all addresses out of reach."""
    import pyogrio

    check_vector_file(path)
    pyogrio.set_gdal_config_options(dict(OFFLINE_OPTIONS))
    opened, options = gdal_read_path(path), {"LIST_ALL_TABLES": "NO"} if path.suffix.lower() == ".gpkg" else {}
    driver = pyogrio.read_info(opened, layer=0, **options)["driver"]
    if driver not in _find_format(path)[1]:
        raise InputError(f"{path} is {driver} by its content; export it again, e.g. as GeoPackage")
    return opened, options


def _find_format(path: Path) -> tuple[tuple[bytes, ...], tuple[str, ...]]:
    known = _VECTOR_FORMATS.get(path.suffix.lower())
    if known is None:
        raise InputError(f"{path} is no vector file by its suffix; there is {', '.join(_VECTOR_FORMATS)}")
    return known
