"""Columns of vector files as the equivalent OpenStreetMap tags."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from catalogs.readers.settings import VECTORS
from catalogs.readers.vectors.column_names import (
    CLASS_COLUMNS,
    EXTRA_TAG_COLUMNS,
    GROUND_COLUMNS,
    GROUND_LEVEL_COLUMNS,
    ROOF_LEVEL_COLUMNS,
    TAG_COLUMNS,
)
from catalogs.readers.vectors.height_units import LENGTH_TAGS, METRES, ColumnUnits
from catalogs.readers.vectors.lengths import is_unknown_code

_ONE_WAY_CODES = ("F", "T")  # Geofabrik: along the line, against it; B for both
_PAIR = re.compile(r'"((?:[^"\\]|\\.)*)"\s*=>\s*"((?:[^"\\]|\\.)*)"')
# Floats of this size skip integers.
MIN_INEXACT_INTEGER = 2**53


def tags_from_records(
    records: Iterable[Mapping[str, object]], columns: Mapping[str, str], units: ColumnUnits = METRES
) -> list[dict[str, str]]:
    """Return the stated tags of each record as text; lengths are in metres, or have a unit.

    `ground` is the height of the ground above the datum; `class` has the values of all class columns, one per line.

    Parameters
    ----------
    records : rows of a layer.
    columns : field by known column name.
    units : units of the columns.
    """

    def select_columns(names: Sequence[str]) -> list[tuple[str, str]]:
        return [(name, columns[name]) for name in names if name in columns]

    layer = _LayerColumns(
        {tag: select_columns(names) for tag, names in TAG_COLUMNS.items()},
        select_columns(EXTRA_TAG_COLUMNS),
        select_columns(CLASS_COLUMNS),
        select_columns(ROOF_LEVEL_COLUMNS),
        select_columns(GROUND_LEVEL_COLUMNS),
        select_columns(GROUND_COLUMNS),
        units,
    )
    result = []
    for record in records:
        tags = layer.read_tags(record)
        if "fclass" in columns and tags.get("oneway") in _ONE_WAY_CODES:
            tags["oneway"] = "yes"
        result.append(layer.add_heights(record, tags))
    return result


@dataclass(frozen=True, slots=True)
class _LayerColumns:
    """Known columns of a layer, (name, field)."""

    tags: Mapping[str, Sequence[tuple[str, str]]]
    extras: Sequence[tuple[str, str]]
    classes: Sequence[tuple[str, str]]
    roof_levels: Sequence[tuple[str, str]]
    ground_levels: Sequence[tuple[str, str]]
    grounds: Sequence[tuple[str, str]]
    units: ColumnUnits

    def read_tags(self, record: Mapping[str, object]) -> dict[str, str]:
        """Return the tags that a record states in columns of their own, or in one of all tags."""
        tags: dict[str, str] = {}
        for _, field in self.extras:
            tags |= _parse_tags(record[field])
        for tag, sources in self.tags.items():
            for name, field in sources:
                if text := cell_text(record[field]):
                    tags[tag] = self._read_tag(tag, name, text)
                    break
        if stated := [text for _, field in self.classes if (text := cell_text(record[field]))]:
            tags["class"] = "\n".join(stated)
        return tags

    def _read_tag(self, tag: str, name: str, text: str) -> str:
        if tag == "height" and is_unknown_code(text):
            return text
        if tag in LENGTH_TAGS:
            return self.units.to_metres(text, name)
        return _primary_name(text) if tag == "name" else text

    def add_heights(self, record: Mapping[str, object], tags: dict[str, str]) -> dict[str, str]:
        """Return the tags with a height by levels above the datum, and with the height of the ground."""
        if "height" not in tags and self.roof_levels and self.ground_levels:
            unit = self.units.metres_per_unit("")
            if found := _height_above_ground(record, self.roof_levels, self.ground_levels, unit):
                tags["height"], tags["ground"] = found
        if "ground" not in tags and (ground := _ground_height(record, self.grounds, self.units)):
            tags["ground"] = ground
        return tags


def assumed_units(tags: Sequence[Mapping[str, str]], columns: Mapping[str, str], units: ColumnUnits) -> list[str]:
    """Return the fields of lengths that state no unit and are taken in that of the frame.

    Parameters
    ----------
    tags : tags of each record.
    columns : field by known column name.
    units : units of the columns.
    """
    names = {tag: TAG_COLUMNS[tag] for tag in LENGTH_TAGS} | {"ground": GROUND_COLUMNS}
    stated = {tag: [name for name in known if name in columns] for tag, known in names.items()}
    return sorted(
        columns[known[0]]
        for tag, known in stated.items()
        if known and units.is_assumed(known[0]) and any(tag in one for one in tags)
    )


def _ground_height(record: Mapping[str, object], grounds: Iterable[tuple[str, str]], units: ColumnUnits) -> str | None:
    """Return the height of the ground in metres, as text; None where no column states a plausible one."""
    for name, field in grounds:
        try:
            height = float(cell_text(record[field])) * units.metres_per_unit(name)
        except ValueError:
            continue
        if VECTORS.ground_range_m[0] < height < VECTORS.ground_range_m[1]:
            return f"{height:.4f}"
    return None


def cell_text(value: object) -> str:
    """Return the text of a cell, empty for null, NaN and blanks.

    Integers have no decimal point. A list of one value counts as the value, since GDAL converts a column to lists
    where one cell is a list.
    """
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list) and len(value) == 1:
        value = value[0]
    if isinstance(value, dict):  # Overture: {"primary": name, ...}, {"value": surface, ...}
        return cell_text(value.get("primary", value.get("value")))
    return _scalar_text(value)


def _scalar_text(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float) and value.is_integer() and abs(value) < MIN_INEXACT_INTEGER:
        return str(int(value))
    text = str(value[: VECTORS.max_cell_length] if isinstance(value, str) else value).strip()
    return "" if text.lower() in ("nan", "none", "null", "<na>", "nat") else text


def _height_above_ground(
    record: Mapping[str, object], roofs: Sequence[tuple[str, str]], grounds: Sequence[tuple[str, str]], unit: float
) -> tuple[str, str] | None:
    """Return the height above the ground and the height of the ground, from heights above the datum."""
    roof, ground = (
        next((text for _, field in fields if (text := cell_text(record[field]))), "") for fields in (roofs, grounds)
    )
    try:
        return f"{(float(roof) - float(ground)) * unit:.2f}", ground if unit == 1.0 else f"{float(ground) * unit:.4f}"
    except ValueError:
        return None


def _parse_tags(value: object) -> dict[str, str]:
    """Return the tags of one cell: JSON, a mapping, or "key"=>"value" pairs."""
    if isinstance(value, str) and value.startswith("{"):
        try:
            value = json.loads(value)
        except (ValueError, RecursionError):
            return {}
    if isinstance(value, dict):
        return {str(key): text for key, stated in value.items() if (text := cell_text(stated))}
    return {key: stated for key, stated in _PAIR.findall(value)} if isinstance(value, str) else {}


def _primary_name(text: str) -> str:
    """Return a name; of a JSON object of names (Overture in GeoJSON) the primary one."""
    if text.startswith("{"):
        try:
            return str(json.loads(text).get("primary") or text)
        except (ValueError, RecursionError):
            return text
    return text
