"""Values that travel between the stages. All are frozen; arrays in them are not to be written to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from shapely import LineString, Polygon


@dataclass(frozen=True, slots=True)
class Element:
    """An axis-parallel rectangle of one class: pixels (or metres), y down, half-open."""

    label: str
    x0: float
    y0: float
    x1: float
    y1: float

    @property
    def width(self) -> float:
        return self.x1 - self.x0

    @property
    def height(self) -> float:
        return self.y1 - self.y0


@dataclass(frozen=True, slots=True)
class Parsing:
    """A parsed facade: labels (H, W) uint8; confidence (H, W, 7) float32, rows sum to 1; occluded (H, W) bool."""

    labels: np.ndarray
    confidence: np.ndarray
    occluded: np.ndarray


@dataclass(frozen=True, slots=True)
class Lattice:
    """An irregular rectangular lattice: sorted split positions in pixels, both borders included."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Completion:
    """A completed layout and its score; higher is better."""

    elements: tuple[Element, ...]
    score: float


@dataclass(frozen=True, slots=True)
class Synthesis:
    """A facade put together from an exemplar's tiles.

    image (H, W, 3) uint8; labels (H, W) uint8, carried along with the tiles; tiles (rows, columns) int32, the
    exemplar tile shown at each node, row-major in the exemplar's lattice; energy, Eq. 4 of the tiles paper.
    """

    image: np.ndarray
    labels: np.ndarray
    tiles: np.ndarray
    energy: float


@dataclass(frozen=True, slots=True)
class Building:
    """A footprint to extrude, in the block's metric frame (metres, z up).

    height is from the ground to the roof; height_source says where it is from: "height", "levels" or "default".
    levels is the number of storeys where the source states it.
    """

    id: str
    footprint: Polygon
    height: float
    height_source: str
    levels: int | None = None
    name: str | None = None


@dataclass(frozen=True, slots=True)
class Street:
    """A street centreline in the block's metric frame (metres)."""

    id: str
    name: str | None
    line: LineString
