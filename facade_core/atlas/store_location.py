"""Location of a store: a local folder or a folder in a bucket."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol, TypeAlias

import icechunk


class BucketFolder(Protocol):
    """Folder in a bucket, supplied by the caller.

    Hashable, picklable for workers, and equal to another instance of the same folder.
    """

    @property
    def name(self) -> str: ...

    @property
    def parent(self) -> BucketFolder: ...

    def __truediv__(self, name: str, /) -> BucketFolder: ...

    def is_dir(self) -> bool:
        """Return True if the folder contains an object."""

    def icechunk_storage(self) -> icechunk.Storage:
        """Return the folder as Icechunk storage, with the credentials of the process that opens it."""

    def sizes(self) -> dict[str, int]:
        """Return the size in bytes of every object below the folder, by path."""

    def read_bytes(self) -> bytes:
        """Return the bytes of an object."""

    def write_text(self, text: str, /) -> object:
        """Write an object in one step."""

    def remove(self) -> object:
        """Remove all objects below the folder."""


StoreLocation: TypeAlias = Path | BucketFolder
