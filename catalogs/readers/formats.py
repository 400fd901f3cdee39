"""Selection of the reader of a geometry file by its suffix.

A new format is one function and one row here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import TypeAlias, cast

from catalogs.crs import metres_per_height_unit
from catalogs.features import BuildingModels, CentrelinesAndGround, Footprints, Remark
from catalogs.reader_errors import wrap_reader_errors
from catalogs.readers.limits import reject_implausible_items
from catalogs.readers.source_keys import NO_SOURCE_KEYS, SourceKeys
from facade_core.core.errors import InputError

# File and level of detail -> buildings; file -> centrelines or ground features. Readers of `_MODULES_WITH_KEYS` also take
# the keys of the source.
BuildingReader: TypeAlias = Callable[..., Footprints | BuildingModels]
CentrelineReader: TypeAlias = Callable[..., CentrelinesAndGround]
_MODULES_WITH_KEYS = ("vectors.vector_files", "json_files", "meshes.models")

_VECTOR_SUFFIXES = (".gpkg", ".geojson", ".parquet", ".geoparquet", ".shp", ".fgb")
# Suffix -> module and function; modules are imported on first use.
BUILDING_READERS: Mapping[str, tuple[str, str]] = {
    ".pbf": ("vectors.osm", "read_osm_footprints"),
    ".json": ("json_files", "read_json_buildings"),
    ".jsonl": ("cityjson.buildings", "read_cityjson"),
    **dict.fromkeys((".gml", ".xml", ".gml.gz"), ("citygml.buildings", "read_citygml")),
    **dict.fromkeys((".obj", ".glb", ".gltf", ".ply", ".npz"), ("meshes.models", "read_mesh_buildings")),
    **dict.fromkeys(_VECTOR_SUFFIXES, ("vectors.vector_files", "read_vector_footprints")),
}
CENTRELINE_READERS: Mapping[str, tuple[str, str]] = {
    ".pbf": ("vectors.osm", "read_osm_centrelines"),
    ".graphml": ("vectors.graphml", "read_graphml_centrelines"),
    **dict.fromkeys((*_VECTOR_SUFFIXES, ".json"), ("vectors.vector_files", "read_vector_centrelines")),
}
GROUND_READERS: Mapping[str, tuple[str, str]] = {
    ".pbf": ("vectors.osm", "read_osm_centrelines"),
    **dict.fromkeys((*_VECTOR_SUFFIXES, ".json"), ("vectors.vector_files", "read_vector_ground")),
}
# Suffixes of common files that are not read, and the remedy.
_REMEDIES: Mapping[str, str] = {
    ".zip .7z .gz .kmz .shz .rar": "unpack it and name the file inside",
    ".osm .o5m .bz2": "convert it with osmium cat IN -o OUT.osm.pbf",
    ".csv .tsv .txt .xlsx": "convert a table with WKT by ogr2ogr -oo GEOM_POSSIBLE_NAMES=WKT -a_srs EPSG:n OUT.gpkg IN",
    ".kml .gpx .tab .mif .dxf .geojsonl .geojsons .topojson .gdb .sqlite": "convert it with ogr2ogr OUT.gpkg IN",
    ".dbf .shx .prj .cpg .qpj": "name the .shp beside it",
    ".citygml": "rename it to .gml",
    ".fbx .dae .blend .skp .3ds .max .usd .usdz .stl .dwg": "export it as OBJ or glTF, in metres",
    ".ifc .rvt": "convert it with IfcConvert IN OUT.obj, in metres",
    ".b3dm .i3dm .cmpt .pnts": "a tile counts from the centre of the Earth: give the model that it was made of",
    ".las .laz .e57 .xyz": "points hold no walls: give outlines, and heights by a raster (buildings.heights)",
}


def read_buildings(
    path: Path, lod: str | None = None, keys: SourceKeys = NO_SOURCE_KEYS
) -> Footprints | BuildingModels:
    """Read the buildings of a file; broken ones and those beyond the limits become faults.

    Parameters
    ----------
    path : file; the suffix selects the reader.
    lod : level of detail of models that have several; None for the highest.
    keys : what the block file states of the file.

    Raises
    ------
    InputError
        For an unknown suffix or a broken file.
    """
    reader, options = _find_reader(path, BUILDING_READERS, keys)
    with wrap_reader_errors(path, f"is not a valid {path.suffix} file", "export it again"):
        found = cast(BuildingReader, reader)(path, lod, *options)
        return reject_implausible_items(_use_frame_unit(found, path, keys), path)


def read_centrelines(path: Path, keys: SourceKeys = NO_SOURCE_KEYS) -> CentrelinesAndGround:
    """Read the street centrelines of a file.

    Broken ones and those beyond the limits become faults.

    Raises
    ------
    InputError
        For an unknown suffix or a broken file.
    """
    reader, options = _find_reader(path, CENTRELINE_READERS, keys)
    with wrap_reader_errors(path, f"is not a valid {path.suffix} file", "export it again"):
        return reject_implausible_items(cast(CentrelineReader, reader)(path, *options), path)


def read_ground_features(path: Path, keys: SourceKeys = NO_SOURCE_KEYS) -> CentrelinesAndGround:
    """Read the ground features of a file; only an OpenStreetMap extract gives centrelines too.

    Raises
    ------
    InputError
        For an unknown suffix or a broken file.
    """
    reader, options = _find_reader(path, GROUND_READERS, keys)
    with wrap_reader_errors(path, f"is not a valid {path.suffix} file", "export it again"):
        return cast(CentrelineReader, reader)(path, *options)


def _use_frame_unit(found: Footprints | BuildingModels, path: Path, keys: SourceKeys) -> Footprints | BuildingModels:
    """Return models without a frame of their own with heights in metres, by the unit of the given frame."""
    if not isinstance(found, BuildingModels) or found.crs is not None or keys.crs is None:
        return found
    unit = metres_per_height_unit(keys.crs)
    if unit == 1.0:
        return found
    remark = Remark("z", f"heights of {path.name} taken in the unit of its frame ({unit:.4f} m)", None)
    return replace(found.scale_heights(unit), remarks=(*found.remarks, remark))


def _find_reader(
    path: Path, readers: Mapping[str, tuple[str, str]], keys: SourceKeys
) -> tuple[object, tuple[SourceKeys, ...]]:
    """Return the reader of a file by its suffix, as the tables above name it, and the keys that it takes."""
    name = path.name.lower()
    found = next((readers[suffix] for suffix in sorted(readers, key=len, reverse=True) if name.endswith(suffix)), None)
    if found is None:
        supported = ", ".join(sorted(readers))
        kind = path.suffix.lower()
        remedy = next((f"{text}; " for suffixes, text in _REMEDIES.items() if kind in suffixes.split()), "")
        raise InputError(
            f"{path}: files of type {path.suffix or '(none)'} are not read; {remedy}supported: {supported}"
        )
    module, function = found
    reader: object = getattr(import_module(f"catalogs.readers.{module}"), function)
    return reader, (keys,) if module in _MODULES_WITH_KEYS else ()
