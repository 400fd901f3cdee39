"""Vectors as tuples of three numbers, for kernels: arrays would be allocated for each."""

from __future__ import annotations

from typing import TypeAlias

from facade_core.core.arrays import Float64Array
from facade_core.core.numba_cache import njit

Vector: TypeAlias = tuple[float, float, float]


@njit(cache=True, inline="always")
def vector(row: Float64Array) -> Vector:
    """Return a row (3,) as a vector."""
    return row[0], row[1], row[2]


@njit(cache=True, inline="always")
def subtract(a: Vector, b: Vector) -> Vector:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(cache=True, inline="always")
def move(a: Vector, share: float, b: Vector) -> Vector:
    """Return a + share * b."""
    return a[0] + share * b[0], a[1] + share * b[1], a[2] + share * b[2]


@njit(cache=True, inline="always")
def dot(a: Vector, b: Vector) -> float:
    """Return the dot product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, inline="always")
def cross(a: Vector, b: Vector) -> Vector:
    """Return the cross product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
