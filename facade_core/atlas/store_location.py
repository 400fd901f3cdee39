"""Where a store lies: a folder of this machine, or one in a bucket, which is given."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeAlias

if TYPE_CHECKING:
    import icechunk


class BucketFolder(Protocol):
    """A folder in a bucket. Equal ones are the same folder; they have a hash, and can be sent to workers."""

    @property
    def name(self) -> str: ...

    @property
    def parent(self) -> BucketFolder: ...

    def __truediv__(self, name: str, /) -> BucketFolder: ...

    def is_dir(self) -> bool:
        """Whether anything lies in it."""

    def icechunk_storage(self) -> icechunk.Storage:
        """Itself as where an Icechunk repository lies. Credentials are those of the process that opens it."""

    def sizes(self) -> dict[str, int]:
        """All that lies below it, by path, in bytes."""

    def write_text(self, text: str, /) -> object:
        """Write an object in one step."""

    def remove(self) -> object:
        """Remove all that lies below it."""


StoreLocation: TypeAlias = Path | BucketFolder
