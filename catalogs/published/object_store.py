"""Objects of a bucket: written whole, over what is known to be there where that is asked, listed, copied and removed."""

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
from typing import TYPE_CHECKING

from facade_core.core.errors import InputError, MachineError

if TYPE_CHECKING:
    from obstore.store import S3Credential, S3Store

# Requests under way at once: they wait for the network, and for little else.
AT_ONCE = 16


@dataclass(frozen=True, slots=True)
class Object:
    """What a listing says of an object: its size in bytes, and when it was written, by the bucket's clock."""

    size: int
    written: datetime


def endpoint() -> str | None:
    """The address that the environment gives for buckets; None for that of AWS."""
    return os.environ.get("AWS_ENDPOINT_URL_S3") or os.environ.get("AWS_ENDPOINT_URL") or None


def put(path: str, data: bytes | Path) -> None:
    """Write an object, by its bucket/key: what is there is replaced in one step."""
    import obstore

    with _answered(path):
        obstore.put(*_at(path), data)


def put_if(path: str, data: bytes, tag: str | None) -> str | None:
    """Write an object only over the version that `tag` names, or only where there is none (tag None).

    Returns the tag of what was written; None where another is there.
    """
    import obstore
    from obstore.exceptions import AlreadyExistsError, NotFoundError, PreconditionError

    try:
        with _answered(path):
            try:
                mode = "create" if tag is None else {"e_tag": tag}
                return obstore.put(*_at(path), data, mode=mode)["e_tag"]  # type: ignore[arg-type]
            except (AlreadyExistsError, PreconditionError, NotFoundError):
                if tag is None or get(path) is not None:
                    raise
                return None  # it was removed meanwhile
    except (AlreadyExistsError, PreconditionError):
        # a request whose answer was lost is sent again, and then meets what it wrote itself
        found = get(path)
        return found[1] if found is not None and found[0] == data else None


def get(path: str) -> tuple[bytes, str] | None:
    """An object and the tag of this version of it; None where there is none."""
    import obstore

    try:
        with _answered(path):
            found = obstore.get(*_at(path))
            return bytes(found.bytes()), str(found.meta["e_tag"])
    except FileNotFoundError:
        return None


def listed(path: str) -> dict[str, Object]:
    """The objects below a bucket/prefix, by the rest of their keys."""
    import obstore

    store, prefix = _at(path + "/")
    with _answered(path):
        return {
            one["path"][len(prefix) :]: Object(one["size"], one["last_modified"])
            for some in obstore.list(store, prefix=prefix or None)
            for one in some
            if not one["path"].endswith("/")
        }


def copy(source: str, target: str) -> None:
    """Have an object under a second name of the same bucket; the bucket copies it by itself."""
    import obstore

    (store, one), (_, other) = _at(source), _at(target)
    with _answered(source):
        obstore.copy(store, one, other)


def delete(paths: Iterable[str]) -> None:
    """Remove objects of one bucket; those that are not there are none the less gone."""
    import obstore

    waiting = list(paths)
    if not waiting:
        return
    with _answered(waiting[0]):
        try:
            obstore.delete(_at(waiting[0])[0], [_at(path)[1] for path in waiting])
        except FileNotFoundError:
            if len(waiting) > 1:  # of several, the others
                for path in waiting:
                    delete([path])


@contextmanager
def _answered(path: str) -> Iterator[None]:
    """What the bucket answers with instead, in one line with the remedy: MachineError, or InputError where the environment
    leads nowhere; FileNotFoundError for what is not there. A condition that does not hold passes as it is."""
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
        if "NoSuchBucket" in str(error):
            raise InputError(f"s3://{path}: there is no such bucket; make it, or name another") from error
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), f"s3://{path}") from error
    except (PermissionDeniedError, UnauthenticatedError, InvalidPathError) as error:
        raise InputError(
            f"s3://{path}: is refused ({_said(error)}); check the name, AWS_REGION and the credentials of the environment"
        ) from error
    except (BaseError, OSError) as error:
        raise MachineError(
            f"s3://{path}: the bucket does not answer as it should ({_said(error)}); check AWS_ENDPOINT_URL and the network, "
            "and run again: what is done is kept"
        ) from error


def _said(error: BaseException) -> str:
    code = re.search(r"<Code>(\w+)</Code>", str(error))
    return code[1] if code else " ".join(str(error).split())[:160]


def _at(path: str) -> tuple[S3Store, str]:
    bucket, _, key = path.partition("/")
    return _store(bucket, endpoint(), os.environ.get("AWS_REGION") or os.environ.get("AWS_DEFAULT_REGION")), key


@lru_cache(maxsize=8)
def _store(bucket: str, address: str | None, region: str | None) -> S3Store:
    """Credentials are the environment's: keys, a profile's keys, a web identity, a container's or a machine's role."""
    from obstore.store import S3Store

    options = {"endpoint": address, "region": region}
    named = not os.environ.get("AWS_ACCESS_KEY_ID") and _of_profile() is not None
    return S3Store(
        bucket,
        credential_provider=_fresh if named else None,
        config={name: value for name, value in options.items() if value},  # type: ignore[arg-type]
        virtual_hosted_style_request=address is None,
        client_options={
            "allow_http": bool(address and address.startswith("http://")),
            "connect_timeout": timedelta(seconds=20),
        },
        retry_config={"max_retries": 5, "retry_timeout": timedelta(seconds=60)},
    )


def _of_profile() -> Mapping[str, str] | None:
    """The keys of the environment's profile, which obstore does not look up; None where there are none."""
    file = os.environ.get("AWS_SHARED_CREDENTIALS_FILE") or Path.home() / ".aws" / "credentials"
    held = RawConfigParser()
    try:
        held.read(file)
        profile = held[os.environ.get("AWS_PROFILE") or "default"]
    except (OSError, KeyError, ParsingError):
        return None
    return profile if {"aws_access_key_id", "aws_secret_access_key"} <= profile.keys() else None


def _fresh() -> S3Credential:
    """The same for obstore, which asks again after some time: the file may be written anew."""
    found = _of_profile()
    if found is None:
        raise InputError("the profile of AWS_SHARED_CREDENTIALS_FILE has no keys any more; see to the file")
    return {
        "access_key_id": found["aws_access_key_id"],
        "secret_access_key": found["aws_secret_access_key"],
        "token": found.get("aws_session_token"),
        "expires_at": datetime.now(UTC) + timedelta(minutes=10),
    }
