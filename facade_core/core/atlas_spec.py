"""Atlas dimensions, and specifications of store arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from facade_core.core.arrays import UInt8Array
from facade_core.core.errors import StoreError
from facade_core.core.zarr_types import COMPRESSORS, StoreArray, StoreGroup

# dtype of strings of any length.
STRING_DTYPE = "string"


@dataclass(frozen=True)
class AtlasSpec:
    """Dimensions of an atlas.

    Attributes
    ----------
    pages : number of pages.
    texels_per_metre : density of charts near streets; pictures may raise that of facades.
    page : side of a page in texels, a multiple of `chunk`.
    chunk : side of a chunk in texels.
    gutter : replicated texels around every chart.
    """

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
        """Return the longest side in metres of a chart that fits a page with its gutters."""
        return (self.page - 2 * self.gutter) / self.texels_per_metre - 1e-6


@dataclass(frozen=True)
class DimensionAndChunkSize:
    """Size of one array dimension in a store, and of a chunk along it."""

    size: int
    chunk: int


@dataclass(frozen=True)
class ArraySpec:
    """Specification of a store array: path, dimension names, dtype, long name and further CF attributes."""

    path: str
    dims: tuple[str, ...]
    dtype: str
    long_name: str
    attributes: Mapping[str, object] = field(default_factory=dict)

    @property
    def attrs(self) -> dict[str, object]:
        """Return the CF attributes of the array."""
        return {"long_name": self.long_name, **self.attributes}

    def create(self, group: StoreGroup, axes: Mapping[str, DimensionAndChunkSize]) -> StoreArray:
        """Create the array empty, replacing an earlier one; only metadata is written."""
        return group.create_array(
            self.path,
            shape=tuple(axes[dim].size for dim in self.dims),
            chunks=tuple(axes[dim].chunk for dim in self.dims),
            dtype=self.dtype,
            dimension_names=self.dims,
            compressors=COMPRESSORS,
            fill_value="" if self.dtype == STRING_DTYPE else 0,
            attributes=self.attrs,
            overwrite=True,
        )

    def write(self, group: StoreGroup, folder: str, values: UInt8Array) -> None:
        """Write `values` as a new array of one chunk in `folder`."""
        axes = {dim: DimensionAndChunkSize(size, size) for dim, size in zip(self.dims, values.shape, strict=True)}
        replace(self, path=f"{folder}/{self.path}").create(group, axes)[:] = values

    def resize(self, group: StoreGroup, axes: Mapping[str, DimensionAndChunkSize]) -> None:
        """Resize the array and keep the common part; create it where it is missing or its chunks differ."""
        if self.path not in group:
            self.create(group, axes)
            return
        array = group[self.path]
        if array.chunks == tuple(axes[dim].chunk for dim in self.dims):
            array.resize(tuple(axes[dim].size for dim in self.dims))
        else:
            self.create(group, axes)
