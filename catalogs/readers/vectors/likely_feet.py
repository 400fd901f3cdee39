"""Heights without a unit that are likely not metres: by the storeys beside them, their size, or the country."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import shapely

from catalogs.crs import LONLAT, coordinate_transform
from catalogs.features import Remark
from catalogs.readers.faces import MAX_COORDINATE
from catalogs.readers.vectors.column_names import TAG_COLUMNS
from catalogs.readers.vectors.height_units import ColumnUnits
from catalogs.readers.vectors.lengths import parse_floor_count
from facade_core.core.arrays import ObjectArray

# Heights of a storey that are feet, metres if they were metres.
_FEET_STOREY_RANGE_M = (7.0, 20.0)
CUT_NAME_LENGTH = 10  # letters of the name of a column of a Shapefile
# Heights of a storey beyond which no unit is likely but decimetres to millimetres, or storeys themselves.
_MAX_STOREY_M = 25.0
_MIN_STOREY_M = 1.5
_MAX_MEDIAN_M = 200.0  # of all heights: more are centimetres or millimetres
_MAX_COUNT_MEDIAN = 4.0  # of whole numbers that may count storeys
_MIN_COUNTED = 3  # different numbers
# Boxes (west, south, east, north), degrees, where surveys count in feet: the United States.
_FEET_AREAS_DEG = ((-125.0, 24.0, -66.5, 49.5), (-180.0, 51.0, -130.0, 72.0), (-161.0, 18.0, -154.0, 23.0))
# Columns of Overture, whose heights are in metres.
_OVERTURE_COLUMNS = frozenset(("is_underground", "has_parts"))


def find_likely_feet(
    name: str,
    geometries: ObjectArray,
    crs: str | None,
    tags: Sequence[Mapping[str, str]],
    columns: Mapping[str, str],
    units: ColumnUnits,
    *,
    has_cut_names: bool = False,
) -> tuple[Remark, ...]:
    """Return a remark on heights that are taken as metres without a stated unit, and may well be feet.

    Parameters
    ----------
    name : name of the file.
    geometries : outlines.
    crs : their frame, None where it is unknown.
    tags : tags of each row, lengths in metres as they are taken.
    columns : field by known column name.
    units : units of the columns.
    has_cut_names : True where the file cuts names to 10 characters, and with them a unit at their end.
    """
    column = next((known for known in TAG_COLUMNS["height"] if known in columns), None)
    if column is None or not units.is_unstated(column):
        return ()
    plain = [(_plain_number(one.get("height", "")), parse_floor_count(one.get("building:levels", ""))) for one in tags]
    storeys = [height / levels for height, levels in plain if height is not None and levels]
    low, high = _FEET_STOREY_RANGE_M
    remedy = f"rename it to {column}_ft where it is in feet, to {column}_m where not"
    if storeys and low <= float(np.median(storeys)) <= high:
        reason = (
            f"heights of {name} taken in metres, {np.median(storeys):.1f} a storey, which looks like feet; {remedy}"
        )
        return (Remark(columns[column], reason, None),)
    if has_cut_names and not storeys and len(columns[column]) == CUT_NAME_LENGTH < len(column):
        reason = f"heights of {name} taken in metres, though a unit may be cut off the column's name; call it height_ft"
        return (Remark(columns[column], f"{reason} or height_m", None),)
    heights = [height for height, _ in plain if height is not None]
    if doubt := _describe_unit_doubt(heights, storeys, is_osm=units.is_osm):
        return (Remark(columns[column], f"heights of {name} taken in metres, {doubt}", None),)
    is_plain = bool(heights)
    if (
        storeys
        or units.is_osm
        or not is_plain
        or not _OVERTURE_COLUMNS.isdisjoint(columns)
        or not _uses_feet(geometries, crs)
    ):
        return ()
    return (Remark(columns[column], f"heights of {name} taken in metres, as no unit is stated; {remedy}", None),)


def _describe_unit_doubt(heights: Sequence[float], storeys: Sequence[float], *, is_osm: bool) -> str | None:
    """Return the doubt about the unit of heights, and the remedy; None where they may be metres.

    Parameters
    ----------
    heights : plain heights.
    storeys : heights of a storey of the rows that state both.
    is_osm : the columns follow OpenStreetMap.
    """
    if storeys and not _MIN_STOREY_M < (middle := float(np.median(storeys))) < _MAX_STOREY_M:
        meant = "levels where it counts storeys" if middle < 2 else "height_dm, height_cm or height_mm"
        return f"{middle:.1f} a storey, which is another unit; call the column {meant}"
    if storeys or is_osm or not heights:
        return None
    if (middle := float(np.median(heights))) > _MAX_MEDIAN_M:
        return f"{middle:.0f} on the median, which is another unit; call the column height_cm or height_mm"
    is_count = len({*heights}) >= _MIN_COUNTED and all(height.is_integer() for height in heights)
    if is_count and middle <= _MAX_COUNT_MEDIAN:
        return f"whole numbers of {middle:g} on the median; where they count storeys, call the column levels"
    return None


def _plain_number(text: str) -> float | None:
    """Return a positive number without a unit; None for any other text."""
    try:
        number = float(text)
    except ValueError:
        return None
    return number if 0.0 < number < float("inf") else None


def _uses_feet(geometries: ObjectArray, crs: str | None) -> bool:
    """Return True where the outlines lie in a country that surveys in feet."""
    bounds = shapely.bounds(geometries)
    bounds = bounds[(np.abs(bounds) < MAX_COORDINATE).all(axis=1)]
    if crs is None or not len(bounds):
        return False
    middle = np.median(bounds, axis=0)
    x, y = coordinate_transform(crs, LONLAT)(middle[[0, 2]].mean(keepdims=True), middle[[1, 3]].mean(keepdims=True))
    return any(west <= x[0] <= east and south <= y[0] <= north for west, south, east, north in _FEET_AREAS_DEG)
