"""Tolerant conversion of parsed JSON to numbers, points, objects and lists."""

from __future__ import annotations

import numpy as np

from catalogs.readers.settings import LIMITS
from facade_core.core.arrays import Float64Array
from facade_core.core.json_types import JsonObject


def apply_transform(points: Float64Array, transform: JsonObject | None) -> Float64Array:
    """Return points (n, 3) scaled and translated by the transform of a file.

    Coordinates beyond LIMITS.max_coordinate become NaN.

    Parameters
    ----------
    points : (n, 3) vertices as stored.
    transform : `scale` and `translate`, or None.
    """
    if transform is not None:
        with np.errstate(over="ignore", invalid="ignore"):
            points = points * np.array(transform["scale"], np.float64) + np.array(transform["translate"], np.float64)
    return far_coordinates_to_nan(points)


def far_coordinates_to_nan(points: Float64Array) -> Float64Array:
    """Return points with NaN for coordinates that are infinite or beyond LIMITS.max_coordinate."""
    return np.where(np.abs(points) < LIMITS.max_coordinate, points, np.nan)


def parse_points(rows: object, size: int = 3) -> Float64Array:
    """Return rows of numbers as (n, size) float64; an invalid row becomes NaN."""
    listed = list_or_empty(rows)
    try:
        points = np.array(listed, np.float64)
    except (TypeError, ValueError, OverflowError):
        points = np.empty(0)
    if points.shape != (len(listed), size):
        points = np.array([_parse_point(row, size) for row in listed], np.float64).reshape(-1, size)
    return points


def _parse_point(row: object, size: int = 3) -> list[float]:
    numbers = [parse_number(value) for value in row] if isinstance(row, list) else []
    return numbers if len(numbers) == size else [np.nan] * size


def parse_number(value: object) -> float:
    """Return a number, also one stored as text; NaN for anything else."""
    try:
        return float(value) if isinstance(value, int | float | str) and not isinstance(value, bool) else np.nan
    except (ValueError, OverflowError):
        return np.nan


def mapping_or_empty(value: object) -> JsonObject:
    """Return an object, or an empty one for any other value."""
    return value if isinstance(value, dict) else {}


def list_or_empty(value: object) -> list[object]:
    """Return a list, or an empty one for any other value."""
    return value if isinstance(value, list) else []
