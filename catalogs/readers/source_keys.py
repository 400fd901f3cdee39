"""Keys of a block file that say how a source is read."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SourceKeys:
    """What a block file states of a source; None where it states nothing.

    Attributes
    ----------
    crs : frame of the file, which replaces its own.
    encoding : code page of the text of Shapefiles.
    up : axis of mesh files that points up, "y" or "z".
    layer : layer of a vector file.
    """

    crs: str | None = None
    encoding: str | None = None
    up: str | None = None
    layer: str | None = None


UP_AXIS_SUFFIXES = (".obj", ".ply", ".stl")  # mesh files whose upward axis a block file may state
# Keys of files of some kinds only: their suffixes, and what the key is.
SUFFIXES_OF_KEYS = {
    "encoding": ((".shp",), "is the code page of a Shapefile"),
    "up": (UP_AXIS_SUFFIXES, "is of OBJ and PLY files"),
    "layer": ((".gpkg",), "is of a GeoPackage"),
    "lod": (
        (".json", ".jsonl", ".gml", ".xml", ".gz"),
        "is of CityJSON and CityGML (a GeoPackage has a layer for each)",
    ),
}
NO_SOURCE_KEYS = SourceKeys()
