"""Layers of vector files: selection, coordinate system and known columns."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import geopandas
import numpy as np
import pyarrow
import pyarrow as pa
import pyarrow.parquet as pq
import shapely
from geopandas import GeoDataFrame
from pyarrow import parquet
from shapely.geometry.base import BaseGeometry

from catalogs.crs import LONLAT, metres_per_height_unit
from catalogs.features import Remark, natural_sort_key
from catalogs.printable_text import normal_form
from catalogs.reader_errors import wrap_reader_errors
from catalogs.readers import gdal_files
from catalogs.readers.gdal_files import check_vector_file
from catalogs.readers.settings import LIMITS, VECTORS
from catalogs.readers.source_keys import NO_SOURCE_KEYS, SourceKeys
from catalogs.readers.vectors.column_names import match_known_columns
from catalogs.readers.vectors.columns import MIN_INEXACT_INTEGER, assumed_units, tags_from_records
from catalogs.readers.vectors.cut_downloads import note_cut_download
from catalogs.readers.vectors.doubtful_heights import (
    find_doubtful_heights,
    ignore_measured_minima,
    mark_gutter_heights,
)
from catalogs.readers.vectors.height_units import column_units
from catalogs.readers.vectors.ids import assign_ids
from catalogs.readers.vectors.shapefile_tables import check_shapefile_table
from catalogs.readers.vectors.shapefile_text import RAW_ENCODING, decode_field_names, decode_shapefile_table
from catalogs.readers.vectors.solids import build_solid, convert_surface_wkb
from facade_core.core.arrays import ObjectArray
from facade_core.core.errors import InputError

_HEIGHT_TAGS = frozenset(("height", "height:eaves", "building:levels"))
_UNREAD_NUMBERS_REASON = (
    "columns of {file} with numbers that are not read; rename heights to height or height_ft, storeys to levels"
)
_SEVERAL_LAYERS_REASON = "layers read of files that have several; the key layer chooses another"
_PARQUET_SUFFIXES = (".parquet", ".geoparquet")
_GEOMETRY_TYPES = {
    "outlines": ("Polygon", "Surface", "TIN", "Triangle"),
    "lines": ("LineString", "MultiCurve", "CompoundCurve"),
}


@dataclass(frozen=True, slots=True)
class LayerFeatures:
    """Features of a layer, row by row.

    Attributes
    ----------
    crs : None where it is unknown.
    ids : unique ids.
    geometries : geometry of each row.
    tags : OpenStreetMap tags of each row.
    id_remarks : remark by id, for ids that differ from the file.
    layer : name of the layer.
    other_layers : names of the layers that were not read.
    remarks : assumptions on the whole layer.
    """

    crs: str | None
    ids: Sequence[str]
    geometries: Sequence[BaseGeometry | None]
    tags: Sequence[dict[str, str]]
    id_remarks: Mapping[str, str]
    layer: str
    other_layers: Sequence[str]
    remarks: Sequence[Remark] = ()


def read_layer_features(
    path: Path, kind: str, name_hints: Sequence[str], keys: SourceKeys = NO_SOURCE_KEYS
) -> LayerFeatures:
    """Read the features of one kind from a vector file.

    Of several layers the stated one is read, else one of that kind: of outlines the last by name that holds solids, else
    preferably one with a hint in its name. The crs is None where the file states none,
    or degrees that its coordinates cannot be. z and lengths are in metres, by the unit of the frame where none is stated.

    Parameters
    ----------
    path : file.
    kind : "outlines" or "lines".
    name_hints : words in the name of the preferred layer.
    keys : what the block file states of the file.

    Raises
    ------
    InputError
        Where the file cannot be read or holds nothing of that kind.
    """
    with wrap_reader_errors(path, "cannot be read", "export it again, e.g. as GeoPackage"):
        _check_file(path)
        if path.suffix.lower() in _PARQUET_SUFFIXES:
            layer, others, remarks = path.stem, list[str](), list[Remark]()
        else:
            layer, others, remarks = _choose_layer(
                path, kind, name_hints, keys.layer if path.suffix.lower() == ".gpkg" else None
            )
        found = _read_table(path, layer, others, keys, with_numbers=kind == "outlines")
        found = replace(found, remarks=[*found.remarks, *remarks])
    types = {geometry.geom_type for geometry in found.geometries if geometry is not None} - {"GeometryCollection"}
    if types and not any(_is_of_kind(one, kind) for one in types):
        raise InputError(f"{path} holds no {kind} but {', '.join(sorted(types))}; give a file with {kind}")
    return found


def read_matching_layers(
    path: Path, is_wanted: Callable[[str, Collection[str]], bool], keys: SourceKeys = NO_SOURCE_KEYS
) -> list[LayerFeatures]:
    """Read the features of all layers that are wanted.

    Parameters
    ----------
    path : file.
    is_wanted : called with the name and the known columns of a layer.
    keys : what the block file states of the file.

    Raises
    ------
    InputError
        Where the file cannot be read.
    """
    with wrap_reader_errors(path, "cannot be read", "export it again, e.g. as GeoPackage"):
        _check_file(path)
        if path.suffix.lower() in _PARQUET_SUFFIXES:
            return [_read_table(path, path.stem, (), keys)]
        return [
            _read_table(path, layer, (), keys)
            for layer in _list_drawn_layers(path)
            if is_wanted(
                layer,
                match_known_columns(
                    gdal_files.read_info(path, layer=layer, **_raw_text(path))["fields"],
                    has_truncated_names=_has_truncated_names(path),
                ),
            )
        ]


def _read_table(
    path: Path, layer: str, others: Sequence[str], keys: SourceKeys, *, with_numbers: bool = False
) -> LayerFeatures:
    """Read a layer; with_numbers: name the columns of numbers that look like heights where none is known."""
    is_parquet = path.suffix.lower() in _PARQUET_SUFFIXES
    frame, columns = _read_parquet(path, with_numbers) if is_parquet else _read_layer(path, layer, with_numbers)
    frame, remarks = _decode_texts(frame, path, keys)
    geometries = frame.geometry.to_numpy()
    unit = metres_per_height_unit(keys.crs or frame.crs)
    rows = frame.drop(columns=frame.geometry.name)
    records = rows.to_dict("records")
    ids, renamed = assign_ids(records, columns)
    units = column_units(columns, unit)
    tags = tags_from_records(records, columns, units)
    in_frame_units = assumed_units(tags, columns, units)
    crs = _crs_name(frame)
    if with_numbers and (heights := _scale_heights(geometries, unit)) is not None:
        geometries, in_frame_units = heights, [*in_frame_units, "z"]
    if in_frame_units:
        reason = (
            f"heights and widths of {path.name} taken in the unit of its frame ({unit:.4f} m); name those in metres"
        )
        remarks.append(Remark(", ".join(in_frame_units), f"{reason} e.g. height_m", None))
    if with_numbers:
        mark_gutter_heights(tags, columns)
        remarks += ignore_measured_minima(tags, columns, path.name)
        remarks += find_doubtful_heights(tags, columns, units, path.name)
    remarks += note_cut_download(path, len(rows))
    if with_numbers and _HEIGHT_TAGS.isdisjoint(chain.from_iterable(tags)):
        unread = rows.drop(columns=list(columns.values()), errors="ignore").select_dtypes("number")
        remarks += [Remark(str(name), _UNREAD_NUMBERS_REASON.format(file=path.name), None) for name in unread]
    return LayerFeatures(crs, ids, geometries, tags, renamed, layer, others, remarks)


def _decode_texts(frame: GeoDataFrame, path: Path, keys: SourceKeys) -> tuple[GeoDataFrame, list[Remark]]:
    if path.suffix.lower() != ".shp":
        return frame, []
    frame, assumed = decode_shapefile_table(frame, path, keys.encoding)
    return frame, [Remark(path.name, f"Shapefiles {assumed}", None)] if assumed else []


def _scale_heights(geometries: ObjectArray, unit: float) -> ObjectArray | None:
    """Return geometries with z in metres; None where it is, or no z differs from zero."""
    if unit == 1.0 or not np.nan_to_num(shapely.get_coordinates(geometries, include_z=True)[:, 2]).any():
        return None
    scaled = geometries.copy()
    solid = shapely.has_z(geometries)
    scaled[solid] = shapely.transform(geometries[solid], lambda xyz: xyz * (1.0, 1.0, unit), include_z=True)
    return scaled


def _check_file(path: Path) -> None:
    check_vector_file(path)
    if path.suffix.lower() == ".shp":
        check_shapefile_table(path)


def _has_truncated_names(path: Path) -> bool:
    """Return True where a file cuts column names to 10 characters."""
    return path.suffix.lower() == ".shp"


def _raw_text(path: Path) -> dict[str, str]:
    """Return the option that reads the text of a Shapefile undecoded; none for other files."""
    return {"encoding": RAW_ENCODING} if path.suffix.lower() == ".shp" else {}


def _list_drawn_layers(path: Path) -> dict[str, str]:
    """Return the type of the geometries by layer."""
    return {name: geometry for name, geometry in gdal_files.list_layers(path) if geometry is not None}


def _is_of_kind(geometry_type: str, kind: str) -> bool:
    return any(known in geometry_type for known in _GEOMETRY_TYPES[kind])


def _choose_layer(
    path: Path, kind: str, name_hints: Sequence[str], stated: str | None
) -> tuple[str, list[str], list[Remark]]:
    """Return the layer to read, the others, and a remark on others of the same kind."""
    listed = _list_drawn_layers(path)
    fitting = [name for name, found in listed.items() if _is_of_kind(found, kind)]
    fitting = fitting or [name for name, found in listed.items() if found in ("Unknown", "GeometryCollection")]
    remarks = []
    if not fitting:
        others = ", ".join(f"{name} ({found})" for name, found in listed.items()) or "no layer with geometry"
        raise InputError(f"{path} holds no {kind} but {others}; give a file with {kind}")
    if stated is not None:
        chosen = next((name for name in fitting if normal_form(name) == normal_form(stated)), None)
        if chosen is None:
            raise InputError(f"{path} has no layer {stated} of {kind}; write as layer one of: {', '.join(fitting)}")
    else:
        chosen = min(fitting, key=lambda name: not any(word in name.lower() for word in name_hints))
        if kind == "outlines" and len(fitting) > 1:
            solids = [name for name in fitting if _holds_solids(path, name)]
            chosen = max(solids, key=natural_sort_key, default=chosen)
        if passed_over := [name for name in fitting if name != chosen]:
            remarks.append(Remark(f"{chosen}, not {', '.join(passed_over)}", _SEVERAL_LAYERS_REASON, None))
    return chosen, [name for name in listed if name != chosen], remarks


def _holds_solids(path: Path, layer: str) -> bool:
    """Return True where a layer begins with a solid; one that cannot be read holds none."""
    frame = gdal_files.read_dataframe(path, layer=layer, columns=[], max_features=1, on_invalid="ignore")
    if frame.geometry.isna().any():
        frame = _restore_surfaces(frame, path, layer)
    is_lonlat = frame.crs is not None and frame.crs.is_geographic
    return any(one is not None and build_solid(one, is_lonlat=is_lonlat) is not None for one in frame.geometry)


def _read_layer(path: Path, layer: str, with_numbers: bool) -> tuple[GeoDataFrame, dict[str, str]]:
    info = gdal_files.read_info(path, layer=layer, **_raw_text(path))
    names = info["fields"]
    fields = decode_field_names(names) if _raw_text(path) else dict(zip(names, names, strict=True))
    columns = match_known_columns(fields, has_truncated_names=_has_truncated_names(path))
    numbers = [
        name
        for (name, raw), kind in zip(fields.items(), info["dtypes"], strict=True)
        if with_numbers and str(kind).startswith(("int", "uint", "float"))
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # broken features become faults
        warnings.filterwarnings("ignore", "Could not parse column", UserWarning)  # read as text
        frame = gdal_files.read_dataframe(
            path,
            layer=layer,
            columns=sorted({fields[name] for name in (*columns.values(), *numbers)}),
            on_invalid="ignore",
            datetime_as_string=True,
            **({"DATE_AS_STRING": "YES"} if info["driver"] == "GeoJSON" else {}),  # GDAL would parse text as dates
            **_raw_text(path),
        )
    if frame.geometry.isna().any():
        frame = _restore_surfaces(frame, path, layer)
    whole = [str(name) for name, kind in zip(info["fields"], info["dtypes"], strict=True) if "int" in str(kind)]
    frame = _restore_integers(frame, whole, lambda names: _read_integers(path, layer, names))
    return frame.rename(columns=dict(zip(fields.values(), fields, strict=True))), columns


def _restore_surfaces(frame: GeoDataFrame, path: Path, layer: str) -> GeoDataFrame:
    """Return the table with PolyhedralSurfaces and TINs, which GEOS does not read, as MultiPolygons."""
    missing = frame.geometry.isna().to_numpy()
    stored = gdal_files.read_raw(path, layer=layer, columns=[], max_features=len(frame))[2]
    geometries = frame.geometry.to_numpy().copy()
    for row in np.flatnonzero(missing).tolist():
        if stored[row] is not None and (wkb := convert_surface_wkb(stored[row])) is not None:
            geometries[row] = shapely.from_wkb(wkb, on_invalid="ignore")
    return frame.set_geometry(geometries, crs=frame.crs)


def _restore_integers(frame: GeoDataFrame, whole: Sequence[str], read: Callable[[list[str]], pa.Table]) -> GeoDataFrame:
    """Return the table with exact integers of over 53 bits: a column with gaps is read as floats.

    whole: fields that hold integers. read: returns an Arrow table of some of them.
    """
    floats = [name for name in whole if name in frame and frame[name].dtype.kind == "f"]
    if lossy := [name for name in floats if (frame[name].abs() >= MIN_INEXACT_INTEGER).any()]:
        table = read(lossy)
        for name in lossy:
            frame[name] = np.array(table[name].to_pylist(), dtype=object)
    return frame


def _read_integers(path: Path, layer: str, names: list[str]) -> pa.Table:
    return gdal_files.read_arrow(path, layer=layer, columns=names, read_geometry=False, **_raw_text(path))[1]


def _read_parquet(path: Path, with_numbers: bool) -> tuple[GeoDataFrame, dict[str, str]]:

    file = parquet.ParquetFile(path)
    if file.metadata.num_rows > LIMITS.max_features:
        raise InputError(f"{path} holds {file.metadata.num_rows} rows; cut out the area that is meant")
    schema = file.schema_arrow
    geo = (schema.metadata or {}).get(b"geo")
    if geo is None:
        raise InputError(f"{path} is Parquet without GeoParquet's metadata; write it with geopandas or GDAL")
    columns = match_known_columns(schema.names, has_truncated_names=False)
    whole = _fields_of_type(schema, pyarrow.types.is_integer)
    wanted = {*columns.values(), json.loads(geo)["primary_column"]}
    if with_numbers:
        wanted.update(whole, _fields_of_type(schema, pyarrow.types.is_floating))
    _check_unpacked_size(path, file, sorted(wanted.intersection(schema.names)))
    frame = geopandas.read_parquet(path, columns=[name for name in schema.names if name in wanted])
    return _restore_integers(frame, whole, lambda names: parquet.read_table(path, columns=names)), columns


def _fields_of_type(schema: pa.Schema, is_of_type: Callable[[pa.DataType], bool]) -> list[str]:
    return [field.name for field in schema if is_of_type(field.type)]


def _check_unpacked_size(path: Path, file: pq.ParquetFile, columns: list[str]) -> None:
    unpacked, most = 0, max(VECTORS.min_unpack_limit_bytes, LIMITS.max_unpack_ratio * path.stat().st_size)
    for batch in file.iter_batches(batch_size=VECTORS.rows_per_batch, columns=columns):
        # dictionary encoding hides the decoded size
        unpacked += sum(
            c.dictionary_decode().nbytes if hasattr(c, "dictionary_decode") else c.nbytes for c in batch.columns
        )
        if unpacked > most:
            raise InputError(f"{path} unpacks to over {LIMITS.max_unpack_ratio} times its size; export it again")


def _crs_name(frame: GeoDataFrame) -> str | None:
    """Return EPSG:n, else WKT, without heights next to degrees; None for a local system, and for degrees that are none."""
    crs = frame.crs
    if crs is None:
        return None
    if crs.is_compound and not crs.sub_crs_list[0].is_projected:
        crs = crs.sub_crs_list[0]
    if crs.is_engineering or crs.name.lower().startswith("undefined"):
        return None
    authority = crs.to_authority()
    if authority in (("OGC", "CRS84"), ("OGC", "CRS84h"), ("EPSG", "4979")):
        authority = ("EPSG", "4326")
    name = ":".join(authority) if authority else crs.to_wkt()
    return None if name == LONLAT and not _are_degrees(frame.geometry.to_numpy()) else name


def _are_degrees(geometries: ObjectArray) -> bool:
    """Return True where coordinates may be degrees, in any order: swapped ones are named later."""
    bounds = shapely.bounds(geometries)
    bounds = bounds[(np.abs(bounds) < LIMITS.max_coordinate).all(axis=1)]
    first, second = np.abs(bounds[:, [0, 2]]), np.abs(bounds[:, [1, 3]])
    if (first <= 360.0).all() and (second <= 90.0).all():
        return True
    is_one_place = bool((np.ptp(bounds.reshape(-1, 2, 2), axis=(0, 1)) <= VECTORS.max_place_deg).all())
    return is_one_place and bool((first <= 90.0).all() and (second <= 360.0).all())
