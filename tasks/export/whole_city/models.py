"""3D Tiles and OpenUSD of a city: the exports of its blocks, and a root that refers to them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from urllib.parse import quote

from facade_core.core.arrays import IntArray
from facade_core.core.json_types import JsonObject
from facade_core.export.attribution import Attribution
from facade_core.export.models.textured_mesh import mesh_y_up_frame
from facade_core.export.models.usd import write_usd_city
from facade_core.export.tiles.city_tileset import build_city_tileset, refer_to_tileset
from tasks.export.usd import write_usd
from tasks.export.whole_city.parts import CityFacts, Part
from tasks.publish.published_run import PublishedBlock

TILESET = "tileset.json"


def join_tilesets(
    folder: Path, parts: Sequence[Part], markers: Iterator[JsonObject], city: CityFacts, attribution: Attribution
) -> list[str]:
    """Write the root tileset; return its name."""
    references = [
        refer_to_tileset(
            quote(f"{part.uri}/{TILESET}"), json.loads((part.folder / TILESET).read_text(encoding="utf-8"))
        )
        for part in parts
    ]
    tileset = build_city_tileset(references, city.name, attribution)
    (folder / TILESET).write_text(json.dumps(tileset, indent=1) + "\n", encoding="utf-8")
    return [TILESET]


def write_usd_part(
    results: PublishedBlock, buildings: IntArray, part: Part, city: CityFacts, options: JsonObject
) -> tuple[list[str], list[str], JsonObject]:
    """Write the stage of a block without its package.

    Returns
    -------
    files : the stage.
    notes : remarks for the user.
    facts : origin of the stage.
    """
    files, notes = write_usd(results, buildings, part.folder, **options, package=False)
    return files, notes, {"origin": mesh_y_up_frame(results.plan.scene.mesh).origin.tolist()}


def join_usd(
    folder: Path, parts: Sequence[Part], markers: Iterator[JsonObject], city: CityFacts, attribution: Attribution
) -> list[str]:
    """Write CITY.usda with the stage of each block as a payload; return its name."""

    def references() -> Iterator[tuple[str, str, list[float]]]:
        for part, marker in zip(parts, markers, strict=True):
            offset = (marker["facts"]["origin"] - city.origin).tolist()
            yield part.block, f"./{part.uri}/{marker['files'][0]}", offset

    name = f"{city.stem}.usda"
    (folder / name).unlink(missing_ok=True)  # of an export that was killed
    metadata = {"city": city.name, "crs": city.crs, "origin": json.dumps(city.origin.tolist()), **attribution.tags()}
    write_usd_city(folder / name, references(), metadata, attribution.line)
    return [name]
