"""CityJSONSeq of a city: one header with one transform, and the features of all blocks."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

from facade_core.core.arrays import IntArray
from facade_core.core.json_types import JsonObject
from facade_core.export.attribution import Attribution
from facade_core.export.city_models.cityjson import empty_document
from tasks.export.city import json_line, write_features
from tasks.export.city_objects import reference_system
from tasks.export.whole_city.parts import CityFacts, Part
from tasks.publish.published_run import PublishedBlock

# Piece of a block: its features, a line each.
FEATURES_FILE = "features.jsonl"
# Between the block and the id of an object.
SEPARATOR = ":"


def write_feature_piece(
    results: PublishedBlock, buildings: IntArray, part: Part, city: CityFacts, options: JsonObject, *, openings: bool
) -> tuple[list[str], list[str], JsonObject]:
    """Write the features of a block as a piece, and its textures into the block's folder.

    In a city of block files every id begins with the block. In a city that was cut into blocks, those of buildings do
    not, because they are unique and corrections refer to them.

    Returns
    -------
    files : files to open first; none.
    notes : remarks for the user.
    facts : none.
    """

    def rename(id: str, is_building: bool) -> str:
        return id if is_building and city.has_unique_ids else f"{part.block}{SEPARATOR}{id}"

    with (part.pieces / FEATURES_FILE).open("w", encoding="utf-8") as file:
        write_features(
            results,
            buildings,
            part.folder,
            file,
            city.origin,
            openings=openings,
            folder_name=f"{part.uri}/",
            rename=rename,
        )
    return [], [], {}


def join_features(
    folder: Path,
    parts: Sequence[Part],
    markers: Iterator[JsonObject],
    city: CityFacts,
    attribution: Attribution,
    *,
    suffix: str,
) -> list[str]:
    """Write CITY and a suffix: the header and the features of all blocks; return its name."""
    url, _ = reference_system(city.crs)
    name = f"{city.stem}{suffix}"
    with (folder / name).open("wb") as file:
        file.write(json_line(empty_document(city.name, city.origin, url, attribution)).encode())
        for part in parts:
            with (part.pieces / FEATURES_FILE).open("rb") as piece:
                shutil.copyfileobj(piece, file)
    return [name]
