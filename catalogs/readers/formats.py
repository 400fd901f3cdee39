"""Selection of the reader of a geometry file by its suffix.

A new format is one function and one row here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import TypeAlias, cast

from catalogs.features import BuildingModels, CentrelinesAndGround, Footprints
from catalogs.reader_errors import wrap_reader_errors
from catalogs.readers.limits import reject_implausible_items
from facade_core.core.errors import InputError

# File and level of detail -> buildings; file -> centrelines or ground features.
BuildingReader: TypeAlias = Callable[[Path, str | None], Footprints | BuildingModels]
CentrelineReader: TypeAlias = Callable[[Path], CentrelinesAndGround]

# Suffix -> module and function; modules are imported on first use.
BUILDING_READERS: Mapping[str, tuple[str, str]] = {
    ".pbf": ("vectors.osm", "read_osm_footprints"),
    ".json": ("json_files", "read_json_buildings"),
    ".jsonl": ("cityjson.buildings", "read_cityjson"),
    ".gml": ("citygml.buildings", "read_citygml"),
    ".xml": ("citygml.buildings", "read_citygml"),
    ".gml.gz": ("citygml.buildings", "read_citygml"),
    ".obj": ("meshes.models", "read_mesh_buildings"),
    ".glb": ("meshes.models", "read_mesh_buildings"),
    ".gltf": ("meshes.models", "read_mesh_buildings"),
    ".ply": ("meshes.models", "read_mesh_buildings"),
    ".npz": ("meshes.models", "read_mesh_buildings"),
    ".gpkg": ("vectors.vector_files", "read_vector_footprints"),
    ".geojson": ("vectors.vector_files", "read_vector_footprints"),
    ".parquet": ("vectors.vector_files", "read_vector_footprints"),
    ".geoparquet": ("vectors.vector_files", "read_vector_footprints"),
    ".shp": ("vectors.vector_files", "read_vector_footprints"),
    ".fgb": ("vectors.vector_files", "read_vector_footprints"),
}
CENTRELINE_READERS: Mapping[str, tuple[str, str]] = {
    ".pbf": ("vectors.osm", "read_osm_centrelines"),
    ".graphml": ("vectors.graphml", "read_graphml_centrelines"),
    ".gpkg": ("vectors.vector_files", "read_vector_centrelines"),
    ".geojson": ("vectors.vector_files", "read_vector_centrelines"),
    ".json": ("vectors.vector_files", "read_vector_centrelines"),
    ".parquet": ("vectors.vector_files", "read_vector_centrelines"),
    ".geoparquet": ("vectors.vector_files", "read_vector_centrelines"),
    ".shp": ("vectors.vector_files", "read_vector_centrelines"),
    ".fgb": ("vectors.vector_files", "read_vector_centrelines"),
}
GROUND_READERS: Mapping[str, tuple[str, str]] = {
    ".pbf": ("vectors.osm", "read_osm_centrelines"),
    ".gpkg": ("vectors.vector_files", "read_vector_ground"),
    ".geojson": ("vectors.vector_files", "read_vector_ground"),
    ".json": ("vectors.vector_files", "read_vector_ground"),
    ".parquet": ("vectors.vector_files", "read_vector_ground"),
    ".geoparquet": ("vectors.vector_files", "read_vector_ground"),
    ".shp": ("vectors.vector_files", "read_vector_ground"),
    ".fgb": ("vectors.vector_files", "read_vector_ground"),
}


def read_buildings(path: Path, lod: str | None = None) -> Footprints | BuildingModels:
    """Read the buildings of a file; broken ones and those beyond the limits become faults.

    Parameters
    ----------
    path : file; the suffix selects the reader.
    lod : level of detail of models that have several; None for the highest.

    Raises
    ------
    InputError
        For an unknown suffix or a broken file.
    """
    reader = cast(BuildingReader, _find_reader(path, BUILDING_READERS))
    with wrap_reader_errors(path, f"{path.suffix} file", "export it again"):
        return reject_implausible_items(reader(path, lod), path)


def read_centrelines(path: Path) -> CentrelinesAndGround:
    """Read the street centrelines of a file.

    Broken ones and those beyond the limits become faults.

    Raises
    ------
    InputError
        For an unknown suffix or a broken file.
    """
    reader = cast(CentrelineReader, _find_reader(path, CENTRELINE_READERS))
    with wrap_reader_errors(path, f"{path.suffix} file", "export it again"):
        return reject_implausible_items(reader(path), path)


def read_ground_features(path: Path) -> CentrelinesAndGround:
    """Read the ground features of a file; only an OpenStreetMap extract gives centrelines too.

    Raises
    ------
    InputError
        For an unknown suffix or a broken file.
    """
    reader = cast(CentrelineReader, _find_reader(path, GROUND_READERS))
    with wrap_reader_errors(path, f"{path.suffix} file", "export it again"):
        return reader(path)


def _find_reader(path: Path, readers: Mapping[str, tuple[str, str]]) -> object:
    """Return the reader of a file by its suffix, as the tables above name it."""
    name = path.name.lower()
    found = next((readers[suffix] for suffix in sorted(readers, key=len, reverse=True) if name.endswith(suffix)), None)
    if found is None:
        supported = ", ".join(sorted(readers))
        raise InputError(f"{path}: files of type {path.suffix or '(none)'} are not read; supported: {supported}")
    module, function = found
    reader: object = getattr(import_module(f"catalogs.readers.{module}"), function)
    return reader
