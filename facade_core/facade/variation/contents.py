"""Contents of the file of a variation hierarchy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from facade_core.core.arrays import Float64Array, Int32Array, IntArray, UInt8Array


@dataclass(frozen=True, slots=True, eq=False)
class VariationLevel:
    """Level of a variation hierarchy: structure matrices and statistics of its types.

    Attributes
    ----------
    grids : per grid, (R, C) int32 structure matrix, -1 for an empty cell.
    counts : (T,) int32 elements of each type at this level.
    probabilities : (T, T) probability that an element of type i in the photo has type j at this level; rows sum to 1.
    """

    grids: tuple[Int32Array, ...]
    counts: Int32Array
    probabilities: Float64Array


@dataclass(frozen=True, slots=True, eq=False)
class ElementGroup:
    """Elements of one label and comparable size.

    Attributes
    ----------
    boxes : (N, 4) int32 pixels.
    light : (N,) relative brightness of the light.
    types : (N,) int32 types in the photo.
    """

    label: str
    boxes: IntArray
    light: Float64Array
    types: Int32Array


class HierarchyContents(NamedTuple):
    """Contents of the file of a variation hierarchy.

    Attributes
    ----------
    levels : level 0 is the photo.
    photo : (H, W, 3) uint8.
    groups : all elements, numbered group by group.
    cells : per grid, element numbers, -1 for none.
    representatives : (T,) int32 element that represents each type.
    """

    levels: tuple[VariationLevel, ...]
    photo: UInt8Array
    groups: tuple[ElementGroup, ...]
    cells: tuple[Int32Array, ...]
    representatives: Int32Array
