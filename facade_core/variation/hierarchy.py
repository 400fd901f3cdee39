"""The variation-factored hierarchy of a facade: its levels, rendered as coded or with its elements exchanged."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from facade_core.errors import InputError
from facade_core.labels import ELEMENT_CLASSES
from facade_core.variation.element_types import Basis
from facade_core.variation.patches import MARGIN


@dataclass(frozen=True, slots=True, eq=False)
class Level:
    """One level: per grid a matrix of element types, and its statistics. Types are numbered over the whole facade.

    grids: (R, C) int32 each, -1 where the grid has no element; counts (T,) int32: elements per type at this level;
    probabilities (T, T): of an element of type i in the photo to be of type j at this level (rows sum to 1).
    """

    grids: tuple[np.ndarray, ...]
    counts: np.ndarray
    probabilities: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Elements of one label and comparable size, coded in one basis.

    boxes (N, 4) int32 pixels; light (N,) brightness; coordinates (N, d); types (N,) int32 in the photo.
    """

    label: str
    basis: Basis
    boxes: np.ndarray
    light: np.ndarray
    coordinates: np.ndarray
    types: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Hierarchy:
    """A facade coded by `encode`: levels, level 0 as photographed, up to one type per grid.

    wall (H, W, 3) uint8: the facade without its elements; groups: all elements, numbered group by group; cells: per
    grid the elements' numbers, -1 for none; representatives (T,) int32: the element that stands for each type.
    """

    levels: tuple[Level, ...]
    wall: np.ndarray
    groups: tuple[Group, ...]
    cells: tuple[np.ndarray, ...]
    representatives: np.ndarray
    _coded: bytes

    @property
    def nbytes(self) -> int:
        """Size of the file in bytes."""
        return len(self._coded)

    def reconstruct(self, level: int) -> np.ndarray:
        """(H, W, 3) uint8: the facade at a level; relabelled elements show their new type's representative."""
        photo, now = self._labels(0), self._labels(level)
        return self._render(np.where(now == photo, np.arange(len(photo)), self.representatives[now]))

    def sample(self, level: int, seed: int) -> np.ndarray:
        """(H, W, 3) uint8: a variation, the elements that share a type at the level exchanged among each other.

        A permutation is a draw from the level's relabelling probabilities that keeps every type's count in the photo.
        """
        now = self._labels(level)
        rng = np.random.default_rng(seed)
        shown = np.arange(len(now))
        for label in np.unique(now):
            members = np.flatnonzero(now == label)
            shown[members] = rng.permutation(members)
        return self._render(shown)

    def to_bytes(self) -> bytes:
        """The file's content, for `from_bytes`."""
        return self._coded

    @staticmethod
    def from_bytes(coded: bytes) -> Hierarchy:
        """Read what `to_bytes` gave; InputError when it is something else or damaged."""
        from facade_core.variation.codec import decode

        return decode(coded)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the one file that `load` reads."""
        Path(path).write_bytes(self._coded)

    @staticmethod
    def load(path: str | PathLike[str]) -> Hierarchy:
        """Read a saved hierarchy; InputError naming the file when it cannot be read."""
        try:
            return Hierarchy.from_bytes(Path(path).read_bytes())
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from error
        except InputError as error:
            raise InputError(f"{path}: {error}") from error

    def _labels(self, level: int) -> np.ndarray:
        """(elements,) type of every element at a level."""
        if not 0 <= level < len(self.levels):
            raise InputError(f"level {level}: this facade has levels 0 to {len(self.levels) - 1}")
        labels = np.zeros(sum(len(g.boxes) for g in self.groups), np.int32)
        for grid, cells in zip(self.levels[level].grids, self.cells, strict=True):
            labels[cells[cells >= 0]] = grid[cells >= 0]
        return labels

    def _render(self, shown: np.ndarray) -> np.ndarray:
        """Paint element shown[i] at the place, and in the light, of element i."""
        import cv2

        canvas = self.wall.astype(np.float32)
        start = 0
        parts = []
        for group in self.groups:
            number = len(group.boxes)
            patches = group.basis.patches(group.coordinates[shown[start : start + number] - start])
            parts.append((group, patches * group.light[:, None, None, None].astype(np.float32)))
            start += number
        # Balconies stand before windows: paint class by class.
        parts.sort(key=lambda part: ELEMENT_CLASSES.index(part[0].label) if part[0].label in ELEMENT_CLASSES else -1)
        height, width = canvas.shape[:2]
        for group, patches in parts:
            for (x0, y0, x1, y1), patch in zip(group.boxes.tolist(), patches, strict=True):
                x0, y0, x1, y1 = x0 - MARGIN, y0 - MARGIN, x1 + MARGIN, y1 + MARGIN
                alpha = np.minimum.outer(_ramp(y1 - y0), _ramp(x1 - x0))[..., None]
                inside = np.s_[max(0, -y0) : height - y0, max(0, -x0) : width - x0]
                target = canvas[max(0, y0) : max(0, y1), max(0, x0) : max(0, x1)]
                pixels = cv2.resize(np.ascontiguousarray(patch), (x1 - x0, y1 - y0), interpolation=cv2.INTER_LINEAR)
                target += alpha[inside] * (pixels[inside] - target)
        return np.clip(canvas.round(), 0, 255).astype(np.uint8)


def _ramp(length: int) -> np.ndarray:
    """(length,) float32: 1 inside, falling towards 0 over the margin at both ends."""
    at = np.arange(length)
    return np.minimum(1, (1 + np.minimum(at, at[::-1])) / (MARGIN + 1)).astype(np.float32)
