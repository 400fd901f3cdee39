"""Heights that do not reach from the ground to the ridge, by the columns and values beside them."""

from __future__ import annotations

from collections.abc import Container, Mapping, MutableMapping, Sequence

import numpy as np
import shapely

from catalogs.features import Remark
from catalogs.readers.vectors.lengths import parse_length
from facade_core.core.arrays import Float64Array, ObjectArray

_MIN_BUILDINGS = 2
_HEIGHT_RANGE_M = (2.0, 80.0)  # of buildings over their ground
_MIN_GROUND_RATIO = 2.0  # of the ground over the height above it: near the sea both readings are possible
_MIN_SPREAD_M = 2.0
_MAX_SPREAD_SHARE = 0.2
_MAX_ROOF_HEIGHT_M = 6.0  # median of roof heights; higher ones count from the ground
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


def ignore_other_heights(
    tags: Sequence[MutableMapping[str, str]], columns: Mapping[str, str], name: str
) -> list[Remark]:
    """Take away least heights of a roof and roof heights from the ground, which have another meaning in OpenStreetMap.

    Parameters
    ----------
    tags : tags of each row, changed in place.
    columns : field by known column name.
    name : name of the file.
    """
    remarks = []
    if "min_height" in columns and any(known in columns for known in _MEASURED_HEIGHTS):
        reason = f"least heights of {name} not taken for lower ends of buildings, as they stand next to other heights"
        remarks += _take_away("min_height", tags, f"{reason} of the roof")
    rises = [rise for one in tags if (rise := parse_length(one.get("roof:height", ""))) is not None]
    is_alone = not any("height" in one or "height:eaves" in one or "roof:shape" in one for one in tags)
    if rises and is_alone and (middle := float(np.median(rises))) > _MAX_ROOF_HEIGHT_M:
        reason = f"roof heights of {name} ignored, since {middle:.1f} m (median) is too much from eaves to ridge"
        remarks += _take_away("roof:height", tags, f"{reason}; where they count from the ground, call them height")
    return remarks


def _take_away(tag: str, tags: Sequence[MutableMapping[str, str]], reason: str) -> list[Remark]:
    counted = sum(one.pop(tag, None) is not None for one in tags)
    return [Remark(f"{counted} buildings", reason, None)] if counted else []


def subtract_ground_heights(tags: Sequence[MutableMapping[str, str]], name: str) -> list[Remark]:
    """Change heights above the datum to heights above the ground where all values show it; return the remark.

    Parameters
    ----------
    tags : tags of each row; `height` is changed.
    name : name of the file.
    """
    rows = [one for one in tags if "height" in one and "ground" in one]
    heights, grounds = (_parse_lengths(rows, key) for key in ("height", "ground"))
    above = heights - grounds
    low, high = _HEIGHT_RANGE_M
    if len(rows) < _MIN_BUILDINGS or not ((above >= low) & (above <= high)).all():
        return []
    if np.median(grounds) < _MIN_GROUND_RATIO * np.median(above):
        return []
    for one, height in zip(rows, above.tolist(), strict=True):
        one["height"] = f"{height:.4f}"
    reason = f"heights of {name} taken above the datum, as all are just above those of the ground, which are subtracted"
    return [Remark(f"{len(rows)} buildings", f"{reason}; leave the ground out where they are not", None)]


def note_roof_heights(tags: Sequence[MutableMapping[str, str]], geometries: ObjectArray, name: str) -> list[Remark]:
    """Return a remark where z of outlines is that of their roofs: z less the height is level, z is not.

    Parameters
    ----------
    tags : tags of each row.
    geometries : outlines.
    name : name of the file.
    """
    rows = [row for row, one in enumerate(tags) if "height" in one and shapely.has_z(geometries[row])]
    if len(rows) < _MIN_BUILDINGS:
        return []
    heights = _parse_lengths([tags[row] for row in rows], "height")
    corners = [shapely.get_coordinates(geometries[row], include_z=True)[:, 2] for row in rows]
    z = np.array([one.min() for one in corners])
    is_level = max(float(np.ptp(one)) for one in corners) < _MIN_SPREAD_M  # no solids
    spread = float(np.ptp(z))
    if not is_level or not spread > _MIN_SPREAD_M or not np.ptp(z - heights) < _MAX_SPREAD_SHARE * spread:
        return []
    reason = f"z of outlines of {name} taken as the ground, though it looks like that of the roofs (z less the height is level)"
    return [Remark("z", f"{reason}; take the height off z, or leave z out and give terrain", None)]


def _parse_lengths(rows: Sequence[MutableMapping[str, str]], key: str) -> Float64Array:
    found = [parse_length(one[key]) for one in rows]
    return np.array([np.nan if value is None else value for value in found], np.float64)
