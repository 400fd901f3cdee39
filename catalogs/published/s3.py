"""Folders of runs in a bucket: s3://bucket/prefix, on AWS or any store that speaks its protocol."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from catalogs.published import object_store
from facade_core.core.errors import InputError

if TYPE_CHECKING:
    import icechunk
    from pyarrow.fs import S3FileSystem

SCHEME = "s3://"
_UNREACHABLE_S = 20.0


@dataclass(frozen=True, slots=True)
class S3Folder:
    """A folder or object in a bucket, with as much of pathlib's interface as runs need. path: bucket/prefix.

    Credentials, region and address are the environment's, as for every tool of AWS: AWS_ACCESS_KEY_ID, AWS_PROFILE, ...,
    AWS_REGION, AWS_ENDPOINT_URL_S3 or AWS_ENDPOINT_URL; of a profile who writes takes keys only. Methods that read raise
    InputError where the bucket does not answer, those that write what `objects` raises.
    """

    path: str

    def __str__(self) -> str:
        return SCHEME + self.path

    def __truediv__(self, name: str) -> S3Folder:
        return S3Folder(f"{self.path}/{name}")

    @property
    def name(self) -> str:
        return self.path.rpartition("/")[2]

    @property
    def parent(self) -> S3Folder:
        return S3Folder(self.path.rpartition("/")[0])

    @property
    def bucket(self) -> str:
        return self.path.partition("/")[0]

    @property
    def prefix(self) -> str:
        return self.path.partition("/")[2]

    def resolve(self) -> S3Folder:
        return self

    def is_dir(self) -> bool:
        return self._kind() == "Directory"

    def is_file(self) -> bool:
        return self._kind() == "File"

    def iterdir(self) -> Iterator[S3Folder]:
        from pyarrow.fs import FileSelector

        with reached(self):
            found = filesystem().get_file_info(FileSelector(self.path))
        return iter([S3Folder(one.path) for one in found])

    def read_bytes(self) -> bytes:
        """Raises FileNotFoundError where there is no such object."""
        try:
            with filesystem().open_input_stream(self.path) as stream:
                return bytes(stream.read())
        except FileNotFoundError:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(self)) from None
        except OSError as error:
            raise _unreached(self, error) from error

    def read_text(self, encoding: str = "utf-8", errors: str = "strict") -> str:
        return self.read_bytes().decode(encoding, errors)

    def write_text(self, text: str, encoding: str = "utf-8") -> None:
        object_store.put(self.path, text.encode(encoding))

    def touch(self) -> None:
        object_store.put(self.path, b"")

    def unlink(self, missing_ok: bool = False) -> None:
        object_store.delete([self.path])

    def sizes(self) -> dict[str, int]:
        """The objects below this folder, by their paths in it, with their sizes in bytes."""
        return {name: one.size for name, one in object_store.listed(self.path).items()}

    def size(self) -> int | None:
        """The bytes of this object; None where there is none."""
        with reached(self):
            return filesystem().get_file_info(self.path).size

    def remove(self) -> None:
        """Remove all that is below this folder."""
        object_store.delete(f"{self.path}/{name}" for name in object_store.listed(self.path))

    def _kind(self) -> str:
        with reached(self):
            return filesystem().get_file_info(self.path).type.name

    def icechunk_storage(self) -> icechunk.Storage:
        """This folder as where an Icechunk repository lies."""
        import icechunk

        endpoint = object_store.endpoint()
        return icechunk.s3_storage(
            bucket=self.bucket,
            prefix=self.prefix,
            region=filesystem().region,
            endpoint_url=endpoint,
            allow_http=bool(endpoint and endpoint.startswith("http://")),
            force_path_style=endpoint is not None,
            from_env=True,
        )


def folder_at(place: str | Path | S3Folder) -> Path | S3Folder:
    """A folder on this machine, or the one in a bucket that `s3://bucket/prefix` names. Raises InputError without a bucket."""
    if isinstance(place, S3Folder) or not str(place).startswith(("s3:/", "S3:/")):
        return place if isinstance(place, S3Folder) else Path(place)
    path = str(place)[3:].strip("/")
    if not path:
        raise InputError(f"{place}: names no bucket; write s3://BUCKET/FOLDER")
    return S3Folder(path)


def filesystem() -> S3FileSystem:
    """The buckets that the environment leads to."""
    return _filesystem(object_store.endpoint(), os.environ.get("AWS_REGION") or os.environ.get("AWS_DEFAULT_REGION"))


@contextmanager
def reached(folder: S3Folder) -> Iterator[None]:
    """What the bucket answers with instead of data, in one line with the remedy."""
    try:
        yield
    except OSError as error:
        raise _unreached(folder, error) from error


def _unreached(folder: S3Folder, error: OSError) -> InputError:
    said = " ".join(str(error).split()).partition(" (Request ID")[0]
    return InputError(
        f"{folder}: cannot be reached ({said[:200]}); check the address, AWS_REGION, AWS_ENDPOINT_URL and the credentials"
    )


@lru_cache(maxsize=2)
def _filesystem(endpoint: str | None, region: str | None) -> S3FileSystem:
    from pyarrow.fs import S3FileSystem

    return S3FileSystem(
        endpoint_override=endpoint,
        region=region,
        connect_timeout=_UNREACHABLE_S,
        allow_delayed_open=True,  # a small file is one request
    )
