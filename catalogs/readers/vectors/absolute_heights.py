"""Heights that count from the datum of the map instead of from the ground, by the values beside them."""

from __future__ import annotations

from collections.abc import MutableMapping, Sequence

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
