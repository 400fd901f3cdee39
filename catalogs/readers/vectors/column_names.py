"""Names of columns in the vector files of many countries, by the OpenStreetMap tag that they state."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping
from itertools import chain
from pathlib import Path

from catalogs.readers.settings import VECTORS
from catalogs.readers.vectors.height_units import LENGTH_TAGS, UNIT_SUFFIXES

# The names, in order of preference: lower case, with underscores for punctuation.
_NAMES = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
# Tag -> names of its column; those of lengths without and with each unit at their end.
TAG_COLUMNS: Mapping[str, tuple[str, ...]] = {
    tag: tuple(f"{name}{suffix}" for suffix in (UNIT_SUFFIXES if tag in LENGTH_TAGS else ("",)) for name in names)
    for tag, names in _NAMES["tags"].items()
}
ROOF_LEVEL_COLUMNS, GROUND_LEVEL_COLUMNS, CLASS_COLUMNS, ID_COLUMNS, EXTRA_TAG_COLUMNS, ELEMENT_TYPE_COLUMNS = (
    tuple(_NAMES[key]) for key in ("roof_levels", "ground_levels", "classes", "ids", "extra_tags", "element_types")
)
GROUND_COLUMNS = tuple(f"{name}{suffix}" for suffix in UNIT_SUFFIXES for name in _NAMES["ground"])
# Prefixes of columns that programs write for a namespace, or for the object that held the values.
_COLUMN_PREFIX = re.compile(r"^(?:bldg|gml|con|core|gen|att|attr|attributes?|properties|props|tags?|osm)_")
# Beginnings of 10 letters that several columns share: altitude_minimale_sol and altitude_maximale_toit.
_AMBIGUOUS_BEGINNINGS = frozenset(("altitude_m",))
_KNOWN_COLUMNS = frozenset(
    (
        *chain.from_iterable(TAG_COLUMNS.values()),
        *ROOF_LEVEL_COLUMNS,
        *GROUND_LEVEL_COLUMNS,
        *GROUND_COLUMNS,
        *CLASS_COLUMNS,
        *ID_COLUMNS,
        *EXTRA_TAG_COLUMNS,
        *ELEMENT_TYPE_COLUMNS,
    )
)
_JOINED_COLUMNS = {
    joined: name
    for name in sorted(_KNOWN_COLUMNS)
    if "_" in name and len(joined := name.replace("_", "")) >= VECTORS.min_joined_length
}


def match_known_columns(fields: Iterable[str], *, has_truncated_names: bool) -> dict[str, str]:
    """Return the field of each known column name.

    has_truncated_names: True where the file cuts names to 10 characters (.shp).
    """
    found: dict[str, str] = {}
    for field in fields:
        name = re.sub(r"[\s:.\-/()\[\]]+", "_", field.strip().lower()).lstrip("@_").rstrip("_")
        names = {name}
        if has_truncated_names and len(name) == 10 and name not in _AMBIGUOUS_BEGINNINGS:
            names = {known for known in _KNOWN_COLUMNS if known.startswith(name)}
        if names.isdisjoint(_KNOWN_COLUMNS):
            plain = _COLUMN_PREFIX.sub("", name)
            names = {plain if plain in _KNOWN_COLUMNS else _JOINED_COLUMNS.get(plain, plain)}
        for known in names & _KNOWN_COLUMNS:
            found.setdefault(known, field)
    return found
