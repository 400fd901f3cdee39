"""What the file of a facade's variation hierarchy holds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class HierarchyLevel:
    """One level: per grid a matrix of element types, and its statistics. Types are numbered over the whole facade.

    grids: (R, C) int32 each, -1 where the grid has no element; counts (T,) int32: elements per type at this level;
    probabilities (T, T): of an element of type i in the photo to be of type j at this level (rows sum to 1).
    """

    grids: tuple[np.ndarray, ...]
    counts: np.ndarray
    probabilities: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class ElementGroup:
    """Elements of one label and comparable size.

    boxes (N, 4) int32 pixels; light (N,) brightness; types (N,) int32 in the photo.
    """

    label: str
    boxes: np.ndarray
    light: np.ndarray
    types: np.ndarray


class HierarchyContents(NamedTuple):
    """A whole file.

    levels: level 0 as photographed;
    photo (H, W, 3) uint8: the facade;
    groups: all elements, numbered group by group;
    cells: per grid the elements' numbers, -1 for none;
    representatives (T,) int32: the element that stands for each type.
    """

    levels: tuple[HierarchyLevel, ...]
    photo: np.ndarray
    groups: tuple[ElementGroup, ...]
    cells: tuple[np.ndarray, ...]
    representatives: np.ndarray
