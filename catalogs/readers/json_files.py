"""Selection of the reader of a JSON file by its content."""

from __future__ import annotations

from pathlib import Path

from catalogs.features import BuildingModels, Footprints
from catalogs.readers import walls
from catalogs.readers.cityjson import buildings as cityjson
from catalogs.readers.json_text import is_json_lines, load_json
from catalogs.readers.source_keys import NO_SOURCE_KEYS, SourceKeys
from catalogs.readers.vectors import vector_files as vectors
from facade_core.core.errors import InputError

_GEOJSON = {"FeatureCollection", "Feature", "GeometryCollection", "Polygon", "MultiPolygon"}
# Members of other JSON of maps, its name and the remedy.
_OTHER_JSON = {
    "geometryType": "Esri JSON; ask the server for f=geojson, or convert it with ogr2ogr OUT.geojson IN",
    "spatialReference": "Esri JSON; ask the server for f=geojson, or convert it with ogr2ogr OUT.geojson IN",
    "arcs": "TopoJSON; convert it with ogr2ogr OUT.geojson IN",
    "elements": "JSON of Overpass; export GeoJSON, or take an extract as .osm.pbf",
}


def read_json_buildings(
    path: Path, lod: str | None = None, keys: SourceKeys = NO_SOURCE_KEYS
) -> Footprints | BuildingModels:
    """Read buildings from CityJSON, GeoJSON or a table of walls.

    Parameters
    ----------
    path : file.
    lod : level of detail, as in catalogs.readers.cityjson.buildings.
    keys : what the block file states of the file.

    Raises
    ------
    InputError
        Where the file is broken or has another content.
    """
    if is_json_lines(path):
        return cityjson.read_cityjson(path, lod)
    document = load_json(path)
    stated = document if isinstance(document, dict) else {}
    kind = str(stated.get("type"))
    if kind.startswith("CityJSON") or "CityObjects" in stated:
        return cityjson.parse_cityjson(stated, path, lod)
    if kind in _GEOJSON:
        return vectors.read_vector_footprints(path, lod, keys)
    if isinstance(stated.get("walls"), dict):
        return walls.read_footprints_from_walls(path, lod)
    unknown = "neither CityJSON, nor GeoJSON, nor a table of walls; convert it"
    other = next((text for key, text in _OTHER_JSON.items() if key in stated), unknown)
    raise InputError(f"{path} holds no buildings: it is {other}")
