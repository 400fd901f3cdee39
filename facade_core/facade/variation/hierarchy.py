"""Variation-factored hierarchy of a facade: levels, reconstruction and sampling."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from facade_core.core.arrays import Int32Array, Int64Array, UInt8Array
from facade_core.core.errors import InputError
from facade_core.core.regular_files import MAX_MODEL_BYTES, read_regular
from facade_core.facade.variation.codec import decode_hierarchy_file
from facade_core.facade.variation.contents import ElementGroup, VariationLevel
from facade_core.facade.variation.enlargement import enlarge_facade
from facade_core.facade.variation.exchange import number_exchange_classes
from facade_core.facade.variation.patches import bare_wall, box_mask
from facade_core.facade.variation.rendering import element_boxes, element_types, paint_photo_elements
from facade_core.facade.variation.sampling import assign_elements_by_type, make_generator, permute_within_types


@dataclass(frozen=True, slots=True, eq=False)
class Hierarchy:
    """Facade encoded by `encode`: level 0 is the photo, the last level has one type per grid.

    Attributes
    ----------
    levels : structure matrices and statistics.
    photo : (H, W, 3) uint8 facade as in the file.
    groups : all elements, numbered group by group.
    cells : per grid, element numbers, -1 for none.
    representatives : (T,) int32 element that represents each type.
    """

    levels: tuple[VariationLevel, ...]
    photo: UInt8Array
    groups: tuple[ElementGroup, ...]
    cells: tuple[Int32Array, ...]
    representatives: Int32Array
    _file_bytes: bytes

    @property
    def nbytes(self) -> int:
        """Return the size of the file in bytes."""
        return len(self._file_bytes)

    @property
    def wall(self) -> UInt8Array:
        """Return the facade without its elements, (H, W, 3) uint8, filled from their surroundings."""
        return bare_wall(self.photo, box_mask(element_boxes(self.groups), self.photo.shape[:2]))

    def types_at(self, level: int) -> Int32Array:
        """Return the (elements,) int32 types of all elements at a level.

        Raises
        ------
        InputError
            For a level that does not exist.
        """
        if not 0 <= level < len(self.levels):
            raise InputError(f"level {level}: this facade has levels 0 to {len(self.levels) - 1}")
        labels = element_types(self.groups).copy()
        for grid, cells in zip(self.levels[level].grids, self.cells, strict=True):
            labels[cells[cells >= 0]] = grid[cells >= 0]
        return labels

    def exchange_classes(self, level: int) -> Int64Array:
        """Return the (elements,) class of each element at a level; those of one class may take each other's place."""
        return number_exchange_classes(self.photo, self.groups, self.types_at(level))

    def reconstruct(self, level: int) -> UInt8Array:
        """Return the photo with relabelled elements shown as the representative of their type, (H, W, 3) uint8."""
        photo, now = self.types_at(0), self.types_at(level)
        places = np.arange(len(photo))
        shown = np.where(now == photo, places, self.representatives[now])
        return paint_photo_elements(self.photo, self.photo, self.groups, places, element_boxes(self.groups), shown)

    def sample(self, level: int, seed: int, *, floors: int | None = None, columns: int | None = None) -> UInt8Array:
        """Sample a variation: permute the elements of one row and head shape that share a type at a level.

        A permutation is a draw from the level's relabelling probabilities that keeps every type's count in the photo.
        Seeds 0, 1 ... give different permutations as long as there are any. With floors or columns, bands are repeated;
        every place shows an element of its type and row, as far as possible from other places of the same element.

        Parameters
        ----------
        level : level whose types are permuted.
        seed : number of the sample, from 0.
        floors, columns : wanted counts of the largest window grid, at least the present ones.

        Returns
        -------
        (H', W', 3) uint8.

        Raises
        ------
        InputError
            For a level that does not exist or a negative seed.
        LayoutError
            For fewer floors or columns than present, or for more without windows.
        """
        classes = self.exchange_classes(level)
        boxes = element_boxes(self.groups)
        if floors is None and columns is None:
            places = np.arange(len(classes))
            return paint_photo_elements(
                self.photo, self.photo, self.groups, places, boxes, permute_within_types(classes, seed)
            )
        rng = make_generator(seed)
        larger = enlarge_facade(self.wall, self.groups, self.cells, floors, columns, rng)
        shown = assign_elements_by_type(classes, larger.places, larger.boxes, rng)
        return paint_photo_elements(larger.wall, self.photo, self.groups, larger.places, larger.boxes, shown)

    def to_bytes(self) -> bytes:
        """Return the content of the file."""
        return self._file_bytes

    @staticmethod
    def from_bytes(coded: bytes) -> Hierarchy:
        """Read the result of `to_bytes`.

        Raises
        ------
        InputError
            If the bytes are damaged or of another kind.
        """
        return Hierarchy(*decode_hierarchy_file(coded), coded)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the file that `load` reads."""
        Path(path).write_bytes(self._file_bytes)

    @staticmethod
    def load(path: str | PathLike[str]) -> Hierarchy:
        """Read a saved hierarchy.

        Raises
        ------
        InputError
            If the file cannot be read; the message names it.
        """
        try:
            return Hierarchy.from_bytes(read_regular(Path(path), MAX_MODEL_BYTES))
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from error
        except InputError as error:
            raise InputError(f"{path}: {error}") from error
