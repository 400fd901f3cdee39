"""Units of lengths in the columns of vector files: the stated one, else that of the frame."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from catalogs.readers.vectors.lengths import FOOT_M, scale_plain_length

# Tags of lengths in metres; `gauge` is in millimetres.
LENGTH_TAGS = frozenset(
    (
        "height", "height:eaves", "min_height", "roof:height", "width", "width:carriageway", "sidewalk:width", "maxheight",
        "sidewalk:left:width", "sidewalk:right:width", "sidewalk:both:width",
    )
)  # fmt: skip
# Columns of maps that follow OpenStreetMap, whose lengths are in metres in any frame.
_OSM_COLUMNS = frozenset(
    ("osm_id", "osmid", "osm_way_id", "full_id", "osm_type", "other_tags", "highway", "building_levels", "roof_levels")
)
# Columns of New York, in feet in any frame; the second ones of files with one of the first.
_NEW_YORK_COLUMNS = frozenset(("heightroof", "height_roof"))
_NEW_YORK_GROUND_COLUMNS = frozenset(("groundelev", "ground_elevation"))
# Endings of columns of lengths.
UNIT_SUFFIXES = ("", "_m", "_meters", "_metres", "_cm", "_mm", "_dm", "_ft", "_feet")
_UNIT_SUFFIX = re.compile(r"_(ft|feet|foot)$|_(m|mm|cm|dm|metres?|meters?)$")
_METRES = {"mm": 0.001, "cm": 0.01, "dm": 0.1}


@dataclass(frozen=True, slots=True)
class ColumnUnits:
    """Units of the columns of a layer.

    Attributes
    ----------
    frame_unit : metres per unit of height of the frame.
    is_osm : the columns follow OpenStreetMap.
    is_new_york : the columns are New York's.
    """

    frame_unit: float = 1.0
    is_osm: bool = False
    is_new_york: bool = False

    def metres_per_unit(self, column: str) -> float:
        """Return the metres per unit of a column by its known name."""
        stated = self._stated_unit(column)
        return stated if stated is not None else 1.0 if self.is_osm else self.frame_unit

    def is_assumed(self, column: str) -> bool:
        """Return True where a column has the unit of its frame, which is not the metre."""
        return self.frame_unit != 1.0 and not self.is_osm and self._stated_unit(column) is None

    def is_unstated(self, column: str) -> bool:
        """Return True where a column is taken as metres, and neither its name nor its frame says so."""
        return self.frame_unit == 1.0 and self._stated_unit(column) is None

    def to_metres(self, text: str, column: str) -> str:
        """Return a length in metres; a text with a unit of its own stays."""
        unit = self.metres_per_unit(column)
        return text if unit == 1.0 else scale_plain_length(text, unit)

    def _stated_unit(self, column: str) -> float | None:
        if column in _NEW_YORK_COLUMNS or (self.is_new_york and column in _NEW_YORK_GROUND_COLUMNS):
            return FOOT_M
        if not (found := _UNIT_SUFFIX.search(column)):
            return None
        return FOOT_M if found[1] else _METRES.get(found[2], 1.0)


def column_units(columns: Mapping[str, str], frame_unit: float) -> ColumnUnits:
    """Return the units of a layer.

    Parameters
    ----------
    columns : field by known column name.
    frame_unit : metres per unit of height of the frame.
    """
    return ColumnUnits(frame_unit, not _OSM_COLUMNS.isdisjoint(columns), not _NEW_YORK_COLUMNS.isdisjoint(columns))


METRES = ColumnUnits()
