"""Folders of runs in a bucket: s3://bucket/prefix, on AWS or any compatible store."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from catalogs.published import object_store
from facade_core.core.errors import InputError

if TYPE_CHECKING:
    import icechunk

S3_SCHEME = "s3://"


@dataclass(frozen=True, slots=True)
class S3Path:
    """Path of a folder or object in a bucket, with the part of pathlib's interface that runs need.

    Credentials, region and address come from the environment, as for AWS tools: AWS_ACCESS_KEY_ID, AWS_PROFILE, ...,
    AWS_REGION, AWS_ENDPOINT_URL_S3 or AWS_ENDPOINT_URL. Of a profile only keys are taken. Methods raise the errors of
    `object_store`.

    Attributes
    ----------
    path : bucket/prefix.
    """

    path: str

    def __str__(self) -> str:
        return S3_SCHEME + self.path

    def __truediv__(self, name: str) -> S3Path:
        return S3Path(f"{self.path}/{name}")

    @property
    def name(self) -> str:
        """Return the last component of the path."""
        return self.path.rpartition("/")[2]

    @property
    def parent(self) -> S3Path:
        """Return the folder above."""
        return S3Path(self.path.rpartition("/")[0])

    @property
    def bucket(self) -> str:
        """Return the name of the bucket."""
        return self.path.partition("/")[0]

    @property
    def prefix(self) -> str:
        """Return the path below the bucket."""
        return self.path.partition("/")[2]

    def resolve(self) -> S3Path:
        """Return the path itself, which is always absolute."""
        return self

    def is_dir(self) -> bool:
        """Return whether any object is below this path."""
        return object_store.has_objects(self.path)

    def is_file(self) -> bool:
        """Return whether an object has this path."""
        return self.size() is not None

    def iterdir(self) -> Iterator[S3Path]:
        """Yield the objects and folders directly below this one."""
        return iter([S3Path(f"{self.bucket}/{key}") for key in object_store.list_folder(self.path)])

    def read_bytes(self) -> bytes:
        """Return the bytes of the object. Raises FileNotFoundError if it does not exist."""
        found = object_store.download_object(self.path)
        if found is None:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(self))
        return found[0]

    def read_text(self, encoding: str = "utf-8", errors: str = "strict") -> str:
        """Return the decoded text of the object."""
        return self.read_bytes().decode(encoding, errors)

    def write_text(self, text: str, encoding: str = "utf-8") -> None:
        """Write a text as the object, replacing it atomically."""
        object_store.upload_object(self.path, text.encode(encoding))

    def touch(self) -> None:
        """Write an empty object."""
        object_store.upload_object(self.path, b"")

    def unlink(self, missing_ok: bool = False) -> None:
        """Delete the object."""
        object_store.delete_objects([self.path])

    def sizes(self) -> dict[str, int]:
        """Return path -> size in bytes of the objects below this folder."""
        return {name: one.size for name, one in object_store.list_objects(self.path).items()}

    def size(self) -> int | None:
        """Return the size of this object in bytes, or None if it does not exist."""
        return object_store.object_size(self.path)

    def remove(self) -> None:
        """Remove all objects below this folder."""
        object_store.delete_objects(f"{self.path}/{name}" for name in object_store.list_objects(self.path))

    def icechunk_storage(self) -> icechunk.Storage:
        """Return this folder as the storage of an Icechunk repository."""
        import icechunk

        endpoint = object_store.endpoint_url()
        return icechunk.s3_storage(
            bucket=self.bucket,
            prefix=self.prefix,
            region=object_store.region() or "us-east-1",
            endpoint_url=endpoint,
            allow_http=bool(endpoint and endpoint.startswith("http://")),
            force_path_style=endpoint is not None,
            from_env=True,
        )


def folder_at(place: str | Path | S3Path) -> Path | S3Path:
    """Return the folder on this machine, or the one in a bucket that `s3://bucket/prefix` names.

    Raises
    ------
    InputError : no bucket is named.
    """
    if isinstance(place, S3Path) or not str(place).startswith(("s3:/", "S3:/")):
        return place if isinstance(place, S3Path) else Path(place)
    path = str(place)[3:].strip("/")
    if not path:
        raise InputError(f"{place}: names no bucket; write s3://BUCKET/FOLDER")
    return S3Path(path)
