"""Objects of a bucket: atomic and conditional writes, listing, copying and removal."""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from configparser import ParsingError, RawConfigParser
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from facade_core.core.errors import BucketUnavailableError, InputError

if TYPE_CHECKING:
    from obstore.store import S3Credential, S3Store
    from pyarrow.fs import PyFileSystem

# Requests mostly wait for the network.
MAX_CONCURRENT_REQUESTS = 16


class NoBucketError(InputError):
    """Bucket that does not exist."""


@dataclass(frozen=True, slots=True)
class ObjectInfo:
    """Size of an object in bytes, and the time it was written by the bucket's clock."""

    size: int
    written: datetime


def endpoint_url() -> str | None:
    """Return the address of buckets from the environment; None for AWS."""
    return os.environ.get("AWS_ENDPOINT_URL_S3") or os.environ.get("AWS_ENDPOINT_URL") or None


def region() -> str | None:
    """Return the region of buckets from the environment; None for the default."""
    return os.environ.get("AWS_REGION") or os.environ.get("AWS_DEFAULT_REGION") or None


def upload_object(path: str, data: bytes | Path) -> None:
    """Write an object, by its bucket/key, replacing it atomically."""
    import obstore

    with translate_errors(path):
        obstore.put(*_locate(path), data)


def upload_if_unchanged(path: str, data: bytes, tag: str | None) -> str | None:
    """Write an object only if its version is still `tag`, or only if it does not exist (tag None).

    Returns
    -------
    Tag of the written version; None if the object has another version.
    """
    import obstore
    from obstore.exceptions import AlreadyExistsError, NotFoundError, PreconditionError

    try:
        with translate_errors(path):
            try:
                mode = "create" if tag is None else {"e_tag": tag}
                return obstore.put(*_locate(path), data, mode=mode)["e_tag"]  # type: ignore[arg-type]
            except (AlreadyExistsError, PreconditionError, NotFoundError):
                if tag is None or download_object(path) is not None:
                    raise
                return None  # it was removed meanwhile
    except (AlreadyExistsError, PreconditionError):
        # a retry after a lost answer finds the object that it wrote itself
        found = download_object(path)
        return found[1] if found is not None and found[0] == data else None


def download_object(path: str) -> tuple[bytes, str] | None:
    """Return an object and the tag of its version, or None if it does not exist."""
    import obstore

    try:
        with translate_errors(path):
            found = obstore.get(*_locate(path))
            return bytes(found.bytes()), str(found.meta["e_tag"])
    except FileNotFoundError:
        return None


def list_objects(path: str) -> dict[str, ObjectInfo]:
    """List the objects below a bucket/prefix, by the rest of their keys."""
    import obstore

    store, prefix = _locate(path + "/")
    with translate_errors(path):
        return {
            one["path"][len(prefix) :]: ObjectInfo(one["size"], one["last_modified"])
            for some in obstore.list(store, prefix=prefix or None)
            for one in some
            if not one["path"].endswith("/")
        }


def has_objects(path: str) -> bool:
    """Return whether any object is below a bucket/prefix."""
    import obstore

    store, prefix = _locate(path + "/")
    try:
        with translate_errors(path):
            return any(len(some) > 0 for some in obstore.list(store, prefix=prefix or None, chunk_size=1))
    except NoBucketError:
        return False


def list_folder(path: str) -> list[str]:
    """List the keys of the objects and folders directly below a bucket/prefix."""
    import obstore

    store, prefix = _locate(path + "/")
    with translate_errors(path):
        found = obstore.list_with_delimiter(store, prefix=prefix or None)
    keys = [*found["common_prefixes"], *(one["path"] for one in found["objects"])]
    return [key.rstrip("/") for key in keys if key != prefix]


def object_size(path: str) -> int | None:
    """Return the size of an object in bytes, or None if it does not exist."""
    import obstore

    try:
        with translate_errors(path):
            return int(obstore.head(*_locate(path))["size"])
    except (FileNotFoundError, NoBucketError):
        return None


def arrow_filesystem() -> PyFileSystem:
    """Return the buckets as a file system of Arrow, which reads parts of objects."""
    from obstore.fsspec import FsspecStore
    from pyarrow.fs import FSSpecHandler, PyFileSystem

    return PyFileSystem(FSSpecHandler(FsspecStore("s3", **_store_options(endpoint_url(), region()))))


def copy_object(source: str, target: str) -> None:
    """Copy an object within a bucket; the bucket copies the data itself."""
    import obstore

    (store, one), (_, other) = _locate(source), _locate(target)
    with translate_errors(source):
        obstore.copy(store, one, other)


def delete_objects(paths: Iterable[str]) -> None:
    """Delete objects of one bucket; missing ones are ignored."""
    import obstore

    waiting = list(paths)
    if not waiting:
        return
    with translate_errors(waiting[0]):
        try:
            obstore.delete(_locate(waiting[0])[0], [_locate(path)[1] for path in waiting])
        except FileNotFoundError:
            if len(waiting) > 1:  # remove the others one by one
                for path in waiting:
                    delete_objects([path])


@contextmanager
def translate_errors(path: str) -> Iterator[None]:
    """Convert errors of the bucket into one line with the remedy.

    Raises BucketUnavailableError, InputError if the environment is wrong, FileNotFoundError for missing objects. Failed
    conditions pass unchanged.
    """
    from obstore.exceptions import (
        AlreadyExistsError,
        BaseError,
        InvalidPathError,
        NotFoundError,
        PermissionDeniedError,
        PreconditionError,
        UnauthenticatedError,
    )

    try:
        yield
    except (AlreadyExistsError, PreconditionError):
        raise
    except (FileNotFoundError, NotFoundError) as error:
        _require_bucket(path, error)
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), f"s3://{path}") from error
    except (PermissionDeniedError, UnauthenticatedError, InvalidPathError) as error:
        raise InputError(
            f"s3://{path}: is refused ({error_text(error)}); check the name, AWS_REGION and the credentials of the environment"
        ) from error
    except (BaseError, OSError) as error:
        _require_bucket(path, error)
        raise BucketUnavailableError(
            f"s3://{path}: the bucket does not answer as it should ({error_text(error)}); check AWS_ENDPOINT_URL and the "
            "network, and run again: finished work is kept"
        ) from error


def _require_bucket(path: str, error: BaseException) -> None:
    if "NoSuchBucket" in str(error):
        raise NoBucketError(f"s3://{path}: there is no such bucket; make it, or name another") from error


def error_text(error: BaseException) -> str:
    """Return the code of a bucket's error, or its first words."""
    code = re.search(r"<Code>(\w+)</Code>", str(error))
    return code[1] if code else " ".join(str(error).split())[:160]


def _locate(path: str) -> tuple[S3Store, str]:
    bucket, _, key = path.partition("/")
    return _open_store(bucket, endpoint_url(), region()), key


@lru_cache(maxsize=8)
def _open_store(bucket: str, address: str | None, region: str | None) -> S3Store:
    """Open a bucket with the environment's credentials: keys, profile, web identity or role."""
    from obstore.store import S3Store

    return S3Store(bucket, **_store_options(address, region))


def _store_options(address: str | None, region: str | None) -> dict[str, Any]:
    options = {"endpoint": address, "region": region}
    named = not os.environ.get("AWS_ACCESS_KEY_ID") and _profile_keys() is not None
    return {
        "credential_provider": _profile_credential if named else None,
        "config": {name: value for name, value in options.items() if value},
        "virtual_hosted_style_request": address is None,
        "client_options": {
            "allow_http": bool(address and address.startswith("http://")),
            "connect_timeout": timedelta(seconds=20),
        },
        "retry_config": {"max_retries": 5, "retry_timeout": timedelta(seconds=60)},
    }


def _profile_keys() -> Mapping[str, str] | None:
    """Return the keys of the environment's profile, or None; obstore does not look them up."""
    file = os.environ.get("AWS_SHARED_CREDENTIALS_FILE") or os.path.expanduser("~/.aws/credentials")
    profiles = RawConfigParser()
    try:
        profiles.read(file)
        profile = profiles[os.environ.get("AWS_PROFILE") or "default"]
    except (OSError, KeyError, ParsingError):
        return None
    return profile if {"aws_access_key_id", "aws_secret_access_key"} <= profile.keys() else None


def _profile_credential() -> S3Credential:
    """Return the profile's keys with an expiry, since the file may be rewritten."""
    found = _profile_keys()
    if found is None:
        raise InputError("the profile of AWS_SHARED_CREDENTIALS_FILE has no keys any more; see to the file")
    return {
        "access_key_id": found["aws_access_key_id"],
        "secret_access_key": found["aws_secret_access_key"],
        "token": found.get("aws_session_token"),
        "expires_at": datetime.now(UTC) + timedelta(minutes=10),
    }
