"""Orthophotos of a city: those of its blocks, a sheet of their sheets, and a STAC Catalog of their Collections."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from urllib.parse import quote

from facade_core.core.json_types import JsonObject
from facade_core.export.attribution import Attribution
from tasks.export.orthophoto_index import (
    CATALOG,
    COLLECTION,
    SHEET,
    read_sheet,
    write_column_sheet,
    write_orthophoto_catalog,
)
from tasks.export.whole_city.parts import CityFacts, Part


def join_orthophotos(
    folder: Path, parts: Sequence[Part], markers: Iterator[JsonObject], city: CityFacts, attribution: Attribution
) -> list[str]:
    """Write facades.vrt, with a row for each block, and catalog.json; return their names."""
    children = [(f"./{quote(part.uri)}/{COLLECTION}", part.block) for part in parts]
    write_orthophoto_catalog(folder / CATALOG, city.name, children)
    rows = [read_sheet(part.folder / SHEET, f"{part.uri}/{SHEET}") for part in parts if (part.folder / SHEET).is_file()]
    if not rows:
        return [CATALOG]
    write_column_sheet(folder / SHEET, rows)
    return [SHEET, CATALOG]
