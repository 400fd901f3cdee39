"""Heights of vector files that contradict each other, or a number of storeys; each doubt is one remark."""

from __future__ import annotations

from collections.abc import Container, Mapping, MutableMapping, Sequence

import numpy as np

from catalogs.features import Remark
from catalogs.readers.settings import VECTORS
from catalogs.readers.vectors.column_names import TAG_COLUMNS
from catalogs.readers.vectors.height_units import ColumnUnits
from catalogs.readers.vectors.lengths import parse_floor_count, parse_length
from facade_core.core.arrays import Float64Array

# Columns of a height of the roof that stand next to a least one: of points measured on it, not a lower end.
_MEASURED_HEIGHTS = ("avg_height", "avg_hgt", "max_height", "max_hgt", "h_avg", "h_mean", "h_median", "h_max")
# Columns of the French map (BD TOPO), where `hauteur` reaches to the gutter.
_FRENCH_GROUND_COLUMNS = ("altitude_minimale_sol", "z_min_sol")


def mark_gutter_heights(tags: Sequence[MutableMapping[str, str]], columns: Container[str]) -> None:
    """Name heights that reach to the eaves in the French map so; changes the tags in place.

    Parameters
    ----------
    tags : tags of each row.
    columns : known column names of the layer.
    """
    if "hauteur" in columns and any(name in columns for name in _FRENCH_GROUND_COLUMNS):
        for one in tags:
            if "height" in one:
                one["height:eaves"] = one.pop("height")


def ignore_measured_minima(
    tags: Sequence[MutableMapping[str, str]], columns: Container[str], name: str
) -> list[Remark]:
    """Take away least heights of a roof, which are lower ends of buildings in OpenStreetMap; return the remark.

    Parameters
    ----------
    tags : tags of each row, changed in place.
    columns : known column names of the layer.
    name : name of the file.
    """
    if "min_height" not in columns or not any(known in columns for known in _MEASURED_HEIGHTS):
        return []
    counted = sum(one.pop("min_height", None) is not None for one in tags)
    reason = f"least heights of {name} not taken for lower ends of buildings, as they stand next to other heights"
    return [Remark(f"{counted} buildings", f"{reason} of the roof", None)] if counted else []


def find_doubtful_heights(
    tags: Sequence[Mapping[str, str]], columns: Mapping[str, str], units: ColumnUnits, name: str
) -> list[Remark]:
    """Return a remark on heights that are no metres above the ground, by the storeys and ground heights beside them.

    Parameters
    ----------
    tags : tags of each row, lengths in metres as they are taken.
    columns : field by known column name.
    units : units of the columns.
    name : name of the file.
    """
    column = next((known for known in TAG_COLUMNS["height"] if known in columns), None)
    if column is None:
        return []
    heights = _values(tags, "height")
    if doubt := _find_doubt(heights, tags, is_unit_stated=not units.is_unstated(column)):
        return [Remark(columns[column], f"heights of {name} taken as metres above the ground, {doubt}", None)]
    return []


def _find_doubt(heights: Float64Array, tags: Sequence[Mapping[str, str]], *, is_unit_stated: bool) -> str | None:
    above = heights - _values(tags, "ground")
    low, high = VECTORS.above_ground_range_m
    is_just_above = (heights > high) & (above >= low) & (above <= high)
    if np.isfinite(above).any() and is_just_above[np.isfinite(above)].all():
        return "but all are just above the heights of the ground beside them; write their difference"
    if is_unit_stated or not np.isfinite(heights).any():
        return None
    levels = [parse_floor_count(one.get("building:levels", "")) or np.nan for one in tags]
    storeys = heights / np.array(levels, np.float64)
    if np.isfinite(storeys).any():
        middle, (low, high) = float(np.nanmedian(storeys)), VECTORS.storey_range_m
        if not low < middle < high:
            return f"{middle:.1f} a storey; call the column by its unit (height_ft, height_dm, height_cm), or levels"
    elif (middle := float(np.nanmedian(heights))) > VECTORS.max_median_height_m:
        return f"{middle:.0f} on the median; call the column by its unit (height_ft, height_cm or height_mm)"
    return None


def _values(tags: Sequence[Mapping[str, str]], key: str) -> Float64Array:
    found = [parse_length(one.get(key, "")) for one in tags]
    return np.array([np.nan if value is None else value for value in found], np.float64)
