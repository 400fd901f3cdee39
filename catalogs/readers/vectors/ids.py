"""Ids of the rows of a vector file."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from catalogs.readers.settings import VECTORS
from catalogs.readers.vectors.column_names import ELEMENT_TYPE_COLUMNS, ID_COLUMNS
from catalogs.readers.vectors.columns import MIN_INEXACT_INTEGER, cell_text

_OSM_ID = re.compile(r"(node|way|relation)/(\d+)")
# GDAL writes numbers of that size in exponent form in text columns.
_INEXACT_NUMBER = re.compile(r"\d\.\d{15,16}e\+\d+")
# Remarks on changed ids, after "buildings of b.gpkg".
_NUMBERED_REMARK = "numbered since another has their id"
_BY_ROW_REMARK = "named by their row, since too few have an id of their own"
_INEXACT_REMARK = "whose id is a number too large to be held whole; write it as text"


def assign_ids(records: list[dict[str, object]], columns: Mapping[str, str]) -> tuple[list[str], dict[str, str]]:
    """Assign an id to each record, and return the remarks on ids that differ from the column.

    The ids are from the first column with complete and unique values, else nearly so, else row numbers. In an incomplete column
    a missing id is row-N and a repeated one gets -2. OpenStreetMap ids become w12 and r12 where the type is known.

    Parameters
    ----------
    records : rows of a layer.
    columns : field by known column name.

    Returns
    -------
    ids : id of each record.
    remarks : remark by id.
    """
    stated = {name: [_id_text(record, name, columns) for record in records] for name in ID_COLUMNS if name in columns}
    fitting = [name for name, texts in stated.items() if _count_ids(texts) >= VECTORS.min_unique_share * len(texts)]
    if not fitting:
        ids = list(map(str, range(len(records))))
        return ids, dict.fromkeys(ids if any(map(any, stated.values())) else (), _BY_ROW_REMARK)
    name = max(fitting, key=lambda name: _count_ids(stated[name]) == len(records))
    ids = _make_unique(stated[name])
    numbered = {id: _NUMBERED_REMARK for id, text in zip(ids, stated[name], strict=True) if text not in ("", id)}
    return ids, _inexact_ids(ids, records, columns[name]) | numbered


def _count_ids(texts: list[str]) -> int:
    return len({*texts} - {""})


def _id_text(record: Mapping[str, object], name: str, columns: Mapping[str, str]) -> str:
    """Return the id that a record states in a known column, with the first letter of its type in OpenStreetMap."""
    text = cell_text(record[columns[name]])
    kind = next(filter(None, map(columns.get, ELEMENT_TYPE_COLUMNS)), None)
    if match := _OSM_ID.fullmatch(text):
        return f"{match[1][0]}{match[2]}"
    if text.isdigit() and kind is not None and name in ("id", "osmid", "osm_id"):
        return f"{cell_text(record[kind])[:1].lower()}{text}"
    if name != "osm_id" or "osm_way_id" not in columns:
        return text
    way = cell_text(record[columns["osm_way_id"]])  # GDAL: osm_id for relations, osm_way_id for ways
    return f"r{text}" if text else f"w{way}" if way else ""


def _inexact_ids(ids: list[str], records: Iterable[Mapping[str, object]], field: str) -> dict[str, str]:
    """Return the remark by id of numbers that a float, or its text by GDAL, cannot hold exactly."""
    cells = [record[field] for record in records]
    return {id: _INEXACT_REMARK for id, cell in zip(ids, cells, strict=True) if _is_inexact(cell)}


def _is_inexact(cell: object) -> bool:
    if isinstance(cell, float):
        return abs(cell) >= MIN_INEXACT_INTEGER
    return isinstance(cell, str) and _INEXACT_NUMBER.fullmatch(cell) is not None


def _make_unique(texts: list[str]) -> list[str]:
    """Return unique ids: missing and repeated ones are numbered."""
    ids: list[str] = []
    known = set(texts)
    seen: set[str] = set()
    for row, text in enumerate(texts):
        text = text or f"row-{row}"
        number = 2
        id = text
        while id in seen or (id != text and id in known):
            id, number = f"{text}-{number}", number + 1
        seen.add(id)
        ids.append(id)
    return ids
