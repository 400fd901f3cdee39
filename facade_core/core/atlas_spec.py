"""The shape of an atlas, and of any array of a store."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from facade_core.core.errors import StoreError
from facade_core.core.zarr_types import StoreArray, StoreGroup

# The dtype of strings of any length.
STRING_DTYPE = "string"


@dataclass(frozen=True)
class AtlasSpec:
    """Pages of page x page texels in chunks of chunk x chunk; a gutter of replicated texels around every chart; the texels per
    metre of charts near streets, the most that any has."""

    pages: int
    texels_per_metre: float
    page: int = 2048
    chunk: int = 128
    gutter: int = 2

    def __post_init__(self) -> None:
        if self.page % self.chunk:
            raise StoreError(
                f"a page of {self.page} texels is not a whole number of chunks of {self.chunk}; change either"
            )
        if self.pages < 1 or self.texels_per_metre <= 0 or not 0 <= self.gutter < self.chunk // 2:
            raise StoreError(f"unusable atlas: {self}; it needs a page, a density and a gutter below half a chunk")

    @property
    def max_chart_side(self) -> float:
        """The longest side in metres of a chart that still fits a page with its gutters."""
        return (self.page - 2 * self.gutter) / self.texels_per_metre - 1e-6


@dataclass(frozen=True)
class Axis:
    """A dimension as one store has it: its size, and that of a chunk along it."""

    size: int
    chunk: int


@dataclass(frozen=True)
class ArraySpec:
    """An array of a store: its path, the names of its dimensions, its dtype, what it holds, and other CF attributes."""

    path: str
    dims: tuple[str, ...]
    dtype: str
    long_name: str
    attributes: Mapping[str, Any] = field(default_factory=dict)

    @property
    def attrs(self) -> dict[str, Any]:
        return {"long_name": self.long_name, **self.attributes}

    def create(self, group: StoreGroup, axes: Mapping[str, Axis]) -> StoreArray:
        """Make the array anew, empty: metadata only."""
        return group.create_array(
            self.path,
            shape=tuple(axes[dim].size for dim in self.dims),
            chunks=tuple(axes[dim].chunk for dim in self.dims),
            dtype=self.dtype,
            dimension_names=self.dims,
            fill_value="" if self.dtype == STRING_DTYPE else 0,
            attributes=self.attrs,
            overwrite=True,
        )

    def write(self, group: StoreGroup, folder: str, values: np.ndarray) -> None:
        """Make the array anew in a folder of its own, of the size of what it holds, in one chunk."""
        axes = {dim: Axis(size, size) for dim, size in zip(self.dims, values.shape, strict=True)}
        replace(self, path=f"{folder}/{self.path}").create(group, axes)[:] = values

    def resize(self, group: StoreGroup, axes: Mapping[str, Axis]) -> None:
        """Resize the array, which keeps what lies in both sizes; where its chunks would be others it is made anew. It is made
        where the store is older than it."""
        if self.path not in group:
            self.create(group, axes)
            return
        array = group[self.path]
        if array.chunks == tuple(axes[dim].chunk for dim in self.dims):
            array.resize(tuple(axes[dim].size for dim in self.dims))
        else:
            self.create(group, axes)
