"""Roofs from the tags of OpenStreetMap's "Simple 3D Buildings"; other sources' columns are first called as those are."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import shapely

from catalogs.readers.vectors.lengths import parse_length, parse_levels
from facade_core.core.types import Roof

# Other spellings of shapes in use; what is not listed is passed on as it is written.
_SHAPES = {"shed": "skillion", "lean-to": "skillion", "monopitch": "skillion", "pent": "skillion", "pitched": "gabled"}
_SHAPES |= {"gable": "gabled", "hip": "hipped", "half-hip": "half-hipped", "pyramid": "pyramidal"}
_NO_SHAPE = frozenset(("", "yes", "no", "many", "unknown", "none", "other"))
_POINTS = ("N", "NNE", "NE", "ENE", "E", "ESE", "SE", "SSE", "S", "SSW", "SW", "WSW", "W", "WNW", "NW", "NNW")

ROOF_STOREY = 2.5  # m; a storey under a roof, as most renderers of OpenStreetMap have it
_PITCH, _SHED_PITCH = 30.0, 10.0  # degrees; where no height is tagged
_USUAL_RISE = 5.0  # m; roofs over wide buildings are flatter than the pitch
_HIGHEST = 100.0  # m; taller ones are slips


def roof_of(tags: Mapping[str, str], outline: Any, *, degrees: bool) -> Roof | None:
    """The roof that is tagged over an outline, which is in metres, or in lon/lat where `degrees`; None where no shape is.

    Its height: roof:height, else roof:levels x ROOF_STOREY, else from roof:angle and the outline's width, else from a usual
    pitch. Directions are taken as they are tagged: clockwise from north.
    """
    shape = tags.get("roof:shape", "").strip().lower().replace("_", "-").replace(" ", "-")
    if shape in _NO_SHAPE or not shape.replace("-", "").isalpha():
        return None
    shape = _SHAPES.get(shape, shape)
    if shape == "flat":
        return Roof("flat", 0.0)
    across = tags.get("roof:orientation", "").strip().lower() == "across"
    height = tagged_rise(tags)
    if height is None:
        angle = parse_length(tags.get("roof:angle", "").strip("° "))
        height = usual_rise(outline, shape, across, degrees, angle if angle and 0 < angle < 80 else None)
    direction = _direction(tags.get("roof:direction") or tags.get("roof:slope:direction") or "")
    return Roof(shape, round(height, 2), direction, across) if height > 0 else Roof("flat", 0.0)


def tagged_rise(tags: Mapping[str, str]) -> float | None:
    """Metres from the eaves to the ridge, as far as they are tagged."""
    height = parse_length(tags.get("roof:height", ""))
    if height is not None and 0 < height <= _HIGHEST:
        return height
    levels = parse_levels(tags.get("roof:levels", ""))
    return None if levels is None or levels > 10 else levels * ROOF_STOREY


def usual_rise(
    outline: Any, shape: str, across: bool = False, degrees: bool = False, angle: float | None = None
) -> float:
    """Height of a roof of a pitch over the smallest rectangle around an outline, in metres, or in lon/lat where `degrees`."""
    flat = shapely.force_2d(outline)
    if degrees:  # lengths of a degree; the sphere is exact enough for a roof
        north = 111_200.0
        scale = np.array([north * math.cos(math.radians(flat.centroid.y)), north])
        flat = shapely.transform(flat, lambda lonlat: lonlat * scale)
    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(flat))
    sides = np.hypot(*np.diff(corners[:3], axis=0).T) if len(corners) >= 3 else np.zeros(2)
    span = float(sides.max() if across else sides.min())
    run = span if shape == "skillion" else span / 2
    if angle is not None:
        return min(run * math.tan(math.radians(angle)), _HIGHEST)
    return min(run * math.tan(math.radians(_SHED_PITCH if shape == "skillion" else _PITCH)), _USUAL_RISE)


def _direction(text: str) -> float | None:
    """Degrees clockwise from north of "135", "135°" or "SE"; None where it is not understood."""
    text = text.strip().strip("°").upper()
    if text in _POINTS:
        return 360.0 / len(_POINTS) * _POINTS.index(text)
    try:
        degrees = float(text)
    except ValueError:
        return None
    return degrees % 360.0 if math.isfinite(degrees) else None
