"""Export formats, one entry each: the command line, a city's exports, the reference page and tests follow from them.

A new format is a module with a writer and an entry here. Writers are imported when they are called, so that the command
line can list the formats at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

    from facade_core.core.arrays import IntArray
    from facade_core.core.json_types import JsonObject
    from facade_core.export.attribution import Attribution
    from tasks.export.whole_city.parts import CityFacts, Part
    from tasks.publish.published_run import PublishedBlock

    # Writes a block: (results, buildings, folder, **options) -> (files to open first, notes).
    Writer = Callable[..., tuple[list[str], list[str]]]
    # (results, buildings, part, city, options) -> (files to open first, notes, facts for the joiner).
    PartWriter = Callable[
        [PublishedBlock, IntArray, Part, CityFacts, JsonObject], tuple[list[str], list[str], JsonObject]
    ]
    # (folder, parts, their markers, city, attribution) -> files to open first.
    PartJoiner = Callable[[Path, Sequence[Part], Iterator[JsonObject], CityFacts, Attribution], list[str]]

# Value of --textures for models of element types and tiling materials.
FACTORED = "factored"
# Suffixes of other files that a user may name as a target.
OTHER_FILE_SUFFIXES = (".tif", ".usdz", ".zip", ".txt")


class Purpose(StrEnum):
    """What an export is for."""

    MODEL = "models"
    ELEMENTS = "elements of the facades"
    GIS = "for GIS"


@dataclass(frozen=True)
class CityFormat:
    """How a format holds a city: a part for each block, and what joins the parts.

    Attributes
    ----------
    content : what the export of a city contains.
    join : writes what joins the parts into the folder; returns the files to open first.
    write_part : writes the part of a block; None: a part is the export of the block alone.
    joins_pieces : a part has pieces, which are gone from a finished export.
    keeps_folders : each block has a folder in the export.
    shares_crs : all blocks must have one coordinate reference system.
    """

    content: str
    join: PartJoiner
    write_part: PartWriter | None = None
    joins_pieces: bool = False
    keeps_folders: bool = True
    shares_crs: bool = True


@dataclass(frozen=True)
class ExportFormat:
    """Format that a published block can be exported to.

    Attributes
    ----------
    name : value of --format.
    purpose : heading of the format in the help of --format.
    content : what the export contains, and in which frame.
    suffix : suffix of the file to open first.
    write : writes the export of a block.
    city : how the format holds a city, or names of formats to use for a city instead.
    options : options of the command line that the format accepts.
    factored_options : options accepted with --textures factored; empty if the format has no factored textures.
    opened_in : third-party programs that the client tests open the export in.
    package : Python package that the writer imports and a plain installation lacks.
    setup : command that installs the package.
    can_be_file : --to may name a single file with the suffix.
    hides_marker : the marker's name begins with a dot, because the format's programs read every .json file.
    """

    name: str
    purpose: Purpose
    content: str
    suffix: str
    write: Writer
    city: CityFormat | tuple[str, ...]
    options: tuple[str, ...] = ()
    factored_options: tuple[str, ...] = ()
    opened_in: tuple[str, ...] = ()
    package: str = ""
    setup: str = ""
    can_be_file: bool = False
    hides_marker: bool = False


def _imported(module: str, name: str, **bound: object) -> Callable[..., Any]:
    """Return a function that imports another when it is called, with some of its arguments bound."""

    def call(*arguments: object, **options: object) -> object:
        return getattr(import_module(f"tasks.export.{module}"), name)(*arguments, **bound, **options)

    return call


def _feature_stream(content: str, suffix: str, *, openings: bool) -> CityFormat:
    """Return a city of CityJSONSeq lines, with textures in the folders of blocks."""
    return CityFormat(
        content,
        join=_imported("whole_city.features", "join_features", suffix=suffix),
        write_part=_imported("whole_city.features", "write_feature_piece", openings=openings),
        joins_pieces=True,
    )


def _tables(content: str, join: str) -> CityFormat:
    """Return a city of map layers."""
    return CityFormat(
        content,
        join=_imported("whole_city.tables", join),
        write_part=_imported("whole_city.tables", "write_map_pieces"),
        joins_pieces=True,
        keeps_folders=False,
    )


_ENTRIES = (
    ExportFormat(
        "glb",
        Purpose.MODEL,
        "block.glb with a node for each building, and a GLB for each, in metres around an origin that its extras state "
        "with the CRS; y up; lit, with variants day and night",
        ".glb",
        _imported("models", "write_glb_models"),
        city=("3dtiles", "usd"),
        options=("lit", "night", "relief"),
        factored_options=("textures",),
        opened_in=("three.js", "Khronos' validator", "Blender"),
    ),
    ExportFormat(
        "3dtiles",
        Purpose.MODEL,
        "3D Tiles 1.1 on the earth (EPSG:4978), with the columns of the catalogue; heights above the ellipsoid by "
        "geoid_separation of the block file; with --crs native in the block's CRS and heights",
        ".json",
        _imported("models", "write_3dtiles"),
        city=CityFormat(
            "tileset.json over a tileset for each block; the folder is usable alone",
            join=_imported("whole_city.models", "join_tilesets"),
            shares_crs=False,
        ),
        options=("textures", "max_texture_mb", "lit", "night", "crs", "relief"),
        factored_options=("textures", "crs"),
        opened_in=("CesiumJS", "3d-tiles-renderer", "Khronos' validator"),
    ),
    ExportFormat(
        "obj",
        Purpose.MODEL,
        "Wavefront OBJ with an object for each building and unlit textures, in the frame of glb; most 3D programs open it",
        ".obj",
        _imported("obj", "write_obj"),
        city=("3dtiles", "usd"),
        options=("relief",),
    ),
    ExportFormat(
        "cityjson",
        Purpose.MODEL,
        "CityJSON 2.0 in the block's CRS: textured LoD2 with semantic surfaces; a Solid for each building with a closed "
        "surface",
        ".city.json",
        _imported("city", "write_cityjson", openings=False),
        city=("cityjsonseq",),
        opened_in=("val3dity", "cjio, Blender"),
    ),
    ExportFormat(
        "cityjsonseq",
        Purpose.MODEL,
        "as cityjson, as a stream with one feature a line",
        ".city.jsonl",
        _imported("city", "write_cityjsonseq"),
        city=_feature_stream("one stream with one transform; textures in blocks/NAME/", ".city.jsonl", openings=False),
    ),
    ExportFormat(
        "lod3",
        Purpose.MODEL,
        "as cityjson, with windows and doors of the completed facades recessed in the walls, balconies and ledges "
        "projecting from them",
        ".lod3.city.json",
        _imported("city", "write_cityjson", openings=True),
        city=_feature_stream("as cityjsonseq, with the openings", ".lod3.city.jsonl", openings=True),
        opened_in=("val3dity", "cjio, Blender"),
    ),
    ExportFormat(
        "citygml",
        Purpose.MODEL,
        "lod3 as CityGML 2.0, textures as its theme rgbTexture; valid against its schemas",
        ".gml",
        _imported("citygml", "write_citygml"),
        city=("lod3", "cityjsonseq"),
    ),
    ExportFormat(
        "coco",
        Purpose.ELEMENTS,
        "elements of every facade on its rectified, completed picture, in pixels, as one COCO file",
        ".json",
        _imported("facades", "write_coco"),
        city=("gpkg", "geoparquet"),
    ),
    ExportFormat(
        "labelme",
        Purpose.ELEMENTS,
        "the same as a LabelMe file for each facade",
        ".json",
        _imported("facades", "write_labelme"),
        city=("gpkg", "geoparquet"),
        hides_marker=True,
    ),
    ExportFormat(
        "gpkg",
        Purpose.GIS,
        "facades (foot lines), buildings, roofs, ground, streets and rejected objects in the block's CRS, with all columns and "
        "QGIS styles",
        ".gpkg",
        _imported("maps", "write_geopackage"),
        city=_tables("one file; the column run names the block, as in query", "join_geopackage"),
        opened_in=("GDAL",),
        can_be_file=True,
    ),
    ExportFormat(
        "geoparquet",
        Purpose.GIS,
        "the layers of gpkg, a file each",
        ".parquet",
        _imported("maps", "write_geoparquet"),
        city=_tables("a file for each layer; the column run names the block", "join_geoparquet"),
    ),
    ExportFormat(
        "cog",
        Purpose.GIS,
        "a lossless orthophoto of each facade as Cloud Optimized GeoTIFF, in metres along and up its wall; its tags and "
        "STAC Item have the wall's pose; facades.vrt shows all side by side",
        ".vrt",
        _imported("orthophotos", "write_cogs"),
        city=CityFormat(
            "a folder for each block, catalog.json (STAC) over their Collections, and facades.vrt with a row for each block",
            join=_imported("whole_city.orthophotos", "join_orthophotos"),
            shares_crs=False,
        ),
        opened_in=("GDAL",),
    ),
    ExportFormat(
        "usd",
        Purpose.MODEL,
        "OpenUSD: a stage that references one for each building, with the columns of the catalogue as customData, also as "
        ".usdz; z up, in metres around an origin that customLayerData states; lit",
        ".usda",
        _imported("usd", "write_usd"),
        city=CityFormat(
            "one stage with each block as a payload, which programs load on demand",
            join=_imported("whole_city.models", "join_usd"),
            write_part=_imported("whole_city.models", "write_usd_part"),
        ),
        options=("lit", "night", "relief"),
        opened_in=("Blender",),
        package="pxr",
        setup="make usd-setup",
    ),
)
FORMATS = {entry.name: entry for entry in _ENTRIES}
# Suffixes of files, which no folder of an export has.
FILE_SUFFIXES = {Path(f"file{entry.suffix}").suffix for entry in _ENTRIES} | {*OTHER_FILE_SUFFIXES}


def list_formats_with(option: str) -> list[str]:
    """List the formats that accept an option of the command line; factored ones are listed separately."""
    whole = [entry.name for entry in _ENTRIES if option in entry.options]
    return whole + [f"{FACTORED} {entry.name}" for entry in _ENTRIES if option in entry.factored_options]


def list_city_formats() -> list[str]:
    """List the formats that hold a city."""
    return [entry.name for entry in _ENTRIES if isinstance(entry.city, CityFormat)]
