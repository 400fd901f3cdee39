"""The variation-factored hierarchy of a facade: its levels, shown with representatives or with its elements exchanged."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from facade_core.core.errors import InputError
from facade_core.facade.variation.codec import decode_file
from facade_core.facade.variation.contents import ElementGroup, HierarchyLevel
from facade_core.facade.variation.enlargement import enlarge_facade
from facade_core.facade.variation.patches import bare_wall, box_mask
from facade_core.facade.variation.rendering import element_boxes, element_types, paint_elements
from facade_core.facade.variation.sampling import assign_by_type, make_generator, permute_within_types


@dataclass(frozen=True, slots=True, eq=False)
class Hierarchy:
    """A facade coded by `encode`: levels, level 0 as photographed, up to one type per grid.

    photo (H, W, 3) uint8: the facade as the file has it; groups: all elements, numbered group by group; cells: per
    grid the elements' numbers, -1 for none; representatives (T,) int32: the element that stands for each type.
    """

    levels: tuple[HierarchyLevel, ...]
    photo: np.ndarray
    groups: tuple[ElementGroup, ...]
    cells: tuple[np.ndarray, ...]
    representatives: np.ndarray
    _file_bytes: bytes

    @property
    def nbytes(self) -> int:
        """Size of the file in bytes."""
        return len(self._file_bytes)

    @property
    def wall(self) -> np.ndarray:
        """(H, W, 3) uint8: the facade without its elements, filled from around them."""
        return bare_wall(self.photo, box_mask(element_boxes(self.groups), self.photo.shape[:2]))

    def types_at(self, level: int) -> np.ndarray:
        """(elements,) int32: the type of every element at a level; InputError for a level that there is not."""
        if not 0 <= level < len(self.levels):
            raise InputError(f"level {level}: this facade has levels 0 to {len(self.levels) - 1}")
        labels = element_types(self.groups).copy()
        for grid, cells in zip(self.levels[level].grids, self.cells, strict=True):
            labels[cells[cells >= 0]] = grid[cells >= 0]
        return labels

    def reconstruct(self, level: int) -> np.ndarray:
        """(H, W, 3) uint8: the photo, in which elements relabelled at a level show their new type's representative."""
        photo, now = self.types_at(0), self.types_at(level)
        places = np.arange(len(photo))
        shown = np.where(now == photo, places, self.representatives[now])
        return paint_elements(self.photo, self.photo, self.groups, places, element_boxes(self.groups), shown)

    def sample(self, level: int, seed: int, *, floors: int | None = None, columns: int | None = None) -> np.ndarray:
        """(H', W', 3) uint8: a variation, the elements that share a type at the level exchanged among each other.

        A permutation is a draw from the level's relabelling probabilities that keeps every type's count in the photo;
        seeds 0, 1 ... give different ones as long as there are any. With floors or columns, at least as many as the
        largest grid of windows has, floors and bays are repeated, every place showing an element of its type at the
        level, as far as can be from where the same one is shown. Raises InputError for a level that there is not or a
        negative seed, LayoutError for fewer floors or columns, or for more where there is no window.
        """
        now = self.types_at(level)
        boxes = element_boxes(self.groups)
        if floors is None and columns is None:
            places = np.arange(len(now))
            return paint_elements(self.photo, self.photo, self.groups, places, boxes, permute_within_types(now, seed))
        rng = make_generator(seed)
        larger = enlarge_facade(self.wall, self.groups, self.cells, floors, columns, rng)
        shown = assign_by_type(now, larger.places, larger.boxes, rng)
        return paint_elements(larger.wall, self.photo, self.groups, larger.places, larger.boxes, shown)

    def to_bytes(self) -> bytes:
        """The file's content, for `from_bytes`."""
        return self._file_bytes

    @staticmethod
    def from_bytes(coded: bytes) -> Hierarchy:
        """Read what `to_bytes` gave; InputError when it is something else or damaged."""
        return Hierarchy(*decode_file(coded), coded)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the one file that `load` reads."""
        Path(path).write_bytes(self._file_bytes)

    @staticmethod
    def load(path: str | PathLike[str]) -> Hierarchy:
        """Read a saved hierarchy; InputError naming the file when it cannot be read."""
        try:
            return Hierarchy.from_bytes(Path(path).read_bytes())
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from error
        except InputError as error:
            raise InputError(f"{path}: {error}") from error
