"""Roofs from the tags of OpenStreetMap's "Simple 3D Buildings" scheme."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from catalogs.readers.settings import VECTORS
from catalogs.readers.vectors.lengths import parse_floor_count, parse_length
from facade_core.core.types import Roof

# Synonyms of shapes; other shapes pass unchanged.
_SHAPE_SYNONYMS = {
    "shed": "skillion",
    "lean-to": "skillion",
    "monopitch": "skillion",
    "pent": "skillion",
    "pitched": "gabled",
}
_SHAPE_SYNONYMS |= {"gable": "gabled", "hip": "hipped", "half-hip": "half-hipped", "pyramid": "pyramidal"}
# Words of other maps, and codes of the German surveys (AdV).
_SHAPE_WORDS = {
    "flat": "flachdach 1000 plat platdak plat-dak toit-plat terrasse terrasses plano piano flate flachgeneigtes-dach",
    "gabled": "satteldach 3100 zadeldak deux-pans dos-aguas a-due-falde harjakatto",
    "hipped": "walmdach 3200 schilddak quatre-pans cuatro-aguas a-padiglione aumakatto",
    "half-hipped": "krüppelwalmdach krueppelwalmdach 3300 wolfsdak",
    "skillion": "pultdach 2100 lessenaarsdak un-pan pulpettikatto",
    "mansard": "mansarddach mansardendach 3400 mansardedak",
    "pyramidal": "zeltdach 3500 tentdak",
    "round": "bogendach tonnendach 3900",
    "dome": "kuppeldach 3700 koepeldak",
    "cone": "kegeldach 3600 kegeldak",
    "sawtooth": "sheddach 3800 zaagtanddak",
}
_SHAPE_SYNONYMS |= {word: shape for shape, words in _SHAPE_WORDS.items() for word in words.split()}
# OpenStreetMap's values; other words are no shapes.
_SHAPES = frozenset(
    (
        *_SHAPE_SYNONYMS.values(), "gambrel", "side-hipped", "saltbox", "double-saltbox", "quadruple-saltbox", "onion",
        "crosspitched", "side-half-hipped", "butterfly", "zig-zag", "hipped-and-gabled", "cross-gabled", "cupola", "conical",
    )
)  # fmt: skip
_SHAPELESS_VALUES = frozenset(("", "yes", "no", "many", "unknown", "none", "other"))
_COMPASS_POINTS = ("N", "NNE", "NE", "ENE", "E", "ESE", "SE", "SSE", "S", "SSW", "SW", "WSW", "W", "WNW", "NW", "NNW")


def parse_roof(tags: Mapping[str, str], outline: BaseGeometry, *, is_lonlat: bool) -> Roof | None:
    """Return the roof of the tags; None without a shape.

    The height is roof:height, else roof:levels x VECTORS.roof_floor_height_m, else from roof:angle and the width of the
    outline, else from a default pitch. Directions are clockwise from north, as tagged.

    Parameters
    ----------
    tags : OpenStreetMap tags.
    outline : outline of the building.
    is_lonlat : True for an outline in degrees, False for metres.
    """
    shape = parse_roof_shape(tags)
    if shape not in _SHAPES:
        return None
    if shape == "flat":
        return Roof("flat", 0.0)
    across = tags.get("roof:orientation", "").strip().lower() == "across"
    height = parse_roof_height(tags)
    if height is None:
        angle = parse_length(tags.get("roof:angle", "").strip("° "))
        height = estimate_roof_height(outline, shape, across, is_lonlat, angle if angle and 0 < angle < 80 else None)
    direction = _parse_direction(tags.get("roof:direction") or tags.get("roof:slope:direction") or "")
    return Roof(shape, round(height, 2), direction, across) if height > 0 else Roof("flat", 0.0)


def parse_roof_shape(tags: Mapping[str, str]) -> str:
    """Return the shape of a roof as OpenStreetMap names it, or the word that is no shape; empty where none is stated."""
    shape = re.sub(r"[\s_-]+", "-", tags.get("roof:shape", "").strip().lower())
    shape = shape.removesuffix("-roof").removesuffix(".0")
    shape = _SHAPE_SYNONYMS.get(shape, shape)
    return "" if shape in _SHAPELESS_VALUES or not shape.replace("-", "").isalpha() else shape


def is_known_roof_shape(shape: str) -> bool:
    """Return True for a value of OpenStreetMap's `roof:shape`."""
    return shape in _SHAPES


def parse_roof_height(tags: Mapping[str, str]) -> float | None:
    """Return the tagged metres from the eaves to the ridge; None without a tag."""
    height = parse_length(tags.get("roof:height", ""))
    if height is not None and 0 < height <= VECTORS.max_roof_height_m:
        return height
    levels = parse_floor_count(tags.get("roof:levels", ""))
    return None if levels is None or levels > 10 else levels * VECTORS.roof_floor_height_m


def estimate_roof_height(
    outline: BaseGeometry, shape: str, is_across: bool = False, is_lonlat: bool = False, pitch_deg: float | None = None
) -> float:
    """Return the height in metres of a pitched roof.

    The span is that of the minimum rotated rectangle of the outline.

    Parameters
    ----------
    outline : outline of the building.
    shape : roof shape.
    is_across : True where the ridge runs along the shorter side.
    is_lonlat : True for an outline in degrees, False for metres.
    pitch_deg : pitch, None for a default.
    """
    flat = shapely.force_2d(outline)
    if is_lonlat:  # metres per degree on a sphere
        north = 111_200.0
        scale = np.array([north * math.cos(math.radians(flat.centroid.y)), north])
        flat = shapely.transform(flat, lambda lonlat: lonlat * scale)
    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(flat))
    sides = np.hypot(*np.diff(corners[:3], axis=0).T) if len(corners) >= 3 else np.zeros(2)
    span = float(sides.max() if is_across else sides.min())
    run = span if shape == "skillion" else span / 2
    if pitch_deg is not None:
        return min(run * math.tan(math.radians(pitch_deg)), VECTORS.max_roof_height_m)
    return min(
        run
        * math.tan(
            math.radians(VECTORS.default_skillion_pitch_deg if shape == "skillion" else VECTORS.default_roof_pitch_deg)
        ),
        VECTORS.max_default_roof_height_m,
    )


def _parse_direction(text: str) -> float | None:
    """Return the degrees clockwise from north of "135", "135°" or "SE"; None for others."""
    text = text.strip().strip("°").upper()
    if text in _COMPASS_POINTS:
        return 360.0 / len(_COMPASS_POINTS) * _COMPASS_POINTS.index(text)
    try:
        degrees = float(text)
    except ValueError:
        return None
    return degrees % 360.0 if math.isfinite(degrees) else None
