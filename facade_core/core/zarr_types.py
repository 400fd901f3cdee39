"""Types of zarr groups and arrays, as zarr's own item types are unions too wide for a type checker."""

from __future__ import annotations

from collections.abc import Iterator, MutableMapping
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, cast

import numpy as np

from facade_core.core.arrays import AnyArray

if TYPE_CHECKING:
    from icechunk import IcechunkStore
    from zarr.core.metadata import ArrayV3Metadata

# Attributes of a group or array: the values of a JSON document.
StoreAttributes: TypeAlias = MutableMapping[str, Any]


class OrthogonalIndex(Protocol):
    """Protocol of `zarr.Array.oindex`."""

    def __getitem__(self, selection: object) -> AnyArray: ...
    def __setitem__(self, selection: object, values: object) -> None: ...


# Compression of chunks, with a checksum: a chunk with a flipped bit is not decoded to other values, but refused.
COMPRESSORS = ({"name": "zstd", "configuration": {"level": 0, "checksum": True}},)
# What zarr's codecs say of a chunk that is cut or garbled.
_DECODING_ERROR = "decompression error"


def is_decoding_error(error: BaseException) -> bool:
    """Return whether an error is that a chunk was read and cannot be decoded: it is damaged."""
    return _DECODING_ERROR in str(error)


# What Icechunk says where a bucket answers with an error of its own, or not at all.
_UNAVAILABLE_ERRORS = ("object store service error", "object store dispatch failure", "object store timeout")


def is_bucket_unavailable(error: BaseException) -> bool:
    """Return whether an error of a store is that its bucket does not answer."""
    return any(text in str(error) for text in _UNAVAILABLE_ERRORS)


class StoreArray(Protocol):
    """Protocol of zarr.Array; reading returns numpy arrays, of no dimension for one element."""

    @property
    def shape(self) -> tuple[int, ...]: ...
    @property
    def chunks(self) -> tuple[int, ...]: ...
    @property
    def ndim(self) -> int: ...
    @property
    def dtype(self) -> np.dtype[np.generic]: ...
    @property
    def attrs(self) -> StoreAttributes: ...
    @property
    def path(self) -> str: ...
    @property
    def fill_value(self) -> object: ...
    @property
    def metadata(self) -> ArrayV3Metadata: ...
    @property
    def oindex(self) -> OrthogonalIndex: ...
    def __getitem__(self, region: object) -> AnyArray: ...
    def __setitem__(self, region: object, values: object) -> None: ...
    def set_block_selection(self, selection: tuple[int, ...], value: object) -> None: ...
    def resize(self, shape: tuple[int, ...]) -> None: ...


class StoreGroup(Protocol):
    """Protocol of zarr.Group; its items are arrays by path, `get_subgroup` returns groups."""

    @property
    def attrs(self) -> StoreAttributes: ...
    @property
    def store(self) -> IcechunkStore: ...
    def __contains__(self, path: str) -> bool: ...
    def __getitem__(self, path: str) -> StoreArray: ...
    def __delitem__(self, path: str) -> None: ...
    def arrays(self) -> Iterator[tuple[str, StoreArray]]: ...
    def groups(self) -> Iterator[tuple[str, StoreGroup]]: ...
    def create_array(self, name: str, **options: object) -> StoreArray: ...
    def create_group(self, name: str, *, overwrite: bool = False) -> StoreGroup: ...
    def require_group(self, name: str) -> StoreGroup: ...


def get_subgroup(group: StoreGroup, path: str) -> StoreGroup:
    """Return the group at a path inside another group.

    Raises
    ------
    KeyError
        Where there is none.
    """
    return cast(StoreGroup, group[path])
