"""Formats that can hold a city: how a block's part is written, and how the parts are joined."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from facade_core.core.arrays import IntArray
from facade_core.core.json_types import JsonObject
from facade_core.export.attribution import Attribution
from tasks.export.whole_city.features import join_features, write_feature_piece
from tasks.export.whole_city.models import join_tilesets, join_usd, write_tiles_part, write_usd_part
from tasks.export.whole_city.orthophotos import join_orthophotos, write_orthophoto_part
from tasks.export.whole_city.parts import CityFacts, Part
from tasks.export.whole_city.tables import join_geopackage, join_geoparquet, write_map_pieces
from tasks.publish.published_run import PublishedBlock

# (results, buildings, part, city, options) -> (files to open first, notes, facts for the joiner).
PartWriter = Callable[[PublishedBlock, IntArray, Part, CityFacts, JsonObject], tuple[list[str], list[str], JsonObject]]
# (folder, parts, their markers, city, attribution) -> files to open first.
PartJoiner = Callable[[Path, Sequence[Part], Iterator[JsonObject], CityFacts, Attribution], list[str]]


@dataclass(frozen=True)
class CityFormat:
    """Format that can hold a city.

    Attributes
    ----------
    write_part : writes the part of a block; returns its files to open first, notes, and facts for `join`.
    join : writes what joins the parts, from the parts and their markers, into the folder; returns files to open first.
    joins_pieces : a part has pieces, which are gone from a finished export.
    keeps_folders : each block has a folder in the export.
    shares_crs : all blocks must have one coordinate reference system.
    is_block_export : a part has the files of the export of the block alone.
    """

    write_part: PartWriter
    join: PartJoiner
    joins_pieces: bool
    keeps_folders: bool
    shares_crs: bool
    is_block_export: bool = False


def _block_exports(write_part: PartWriter, join: PartJoiner) -> CityFormat:
    """Return a format of which each part is the export of a block alone."""
    return CityFormat(write_part, join, joins_pieces=False, keeps_folders=True, shares_crs=False, is_block_export=True)


def _features(openings: bool, suffix: str) -> CityFormat:
    """Return a format of lines of CityJSONSeq, with textures in the folders of blocks."""
    return CityFormat(
        partial(write_feature_piece, openings=openings),
        partial(join_features, suffix=suffix),
        joins_pieces=True,
        keeps_folders=True,
        shares_crs=True,
    )


def _tables(join: PartJoiner) -> CityFormat:
    """Return a format of map layers."""
    return CityFormat(write_map_pieces, join, joins_pieces=True, keeps_folders=False, shares_crs=True)


CITY_FORMATS = {
    "3dtiles": _block_exports(write_tiles_part, join_tilesets),
    "cityjsonseq": _features(False, ".city.jsonl"),
    "lod3": _features(True, ".lod3.city.jsonl"),
    "gpkg": _tables(join_geopackage),
    "geoparquet": _tables(join_geoparquet),
    "cog": _block_exports(write_orthophoto_part, join_orthophotos),
    "usd": CityFormat(write_usd_part, join_usd, joins_pieces=False, keeps_folders=True, shares_crs=True),
}
# What to use in place of a format that holds one block.
ALTERNATIVES = {
    "glb": "3dtiles or usd",
    "cityjson": "cityjsonseq",
    "citygml": "lod3 or cityjsonseq",
    "coco": "gpkg or geoparquet",
    "labelme": "gpkg or geoparquet",
}
