"""A bucket for tests: a server on loopback, which is not believed until it was seen to keep conditions."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from threading import Barrier

import pytest

from benchmarks.s3_server import serving
from catalogs.published import object_store

# Two of an access key's parts; whoever finds the second in anything that was written has found a leak.
KEY, SECRET = "AKIDOFATEST", "tHisIsASeCretThatMustBeNowhere/0123456789"


@contextmanager
def served(name: str) -> Iterator[str]:
    """An empty bucket, which the environment leads to. What keeps no conditions ends the test."""
    pytest.importorskip("moto")
    with serving(name, KEY, SECRET) as variables, pytest.MonkeyPatch.context() as environment:
        for variable, value in variables.items():
            environment.setenv(variable, value)
        require_conditions(name)
        yield f"s3://{name}"


def require_conditions(bucket: str) -> None:
    """Of many who write at once over one version, or over none, one must succeed, and the object be what that one wrote."""
    path, writers = f"{bucket}/conditions", 8

    def write(data: bytes, over: str | None, together: Barrier) -> str | None:
        together.wait()
        return object_store.upload_if_unchanged(path, data, over)

    tag: str | None = None
    with ThreadPoolExecutor(writers) as threads:
        for turn in range(6):  # the first over nothing, the others over what was written last
            together = Barrier(writers)
            data = [f"{turn}/{number}".encode() for number in range(writers)]  # tags are of what is written
            tags = list(threads.map(lambda one: write(one, tag, together), data))  # noqa: B023
            won = [one for one, written in zip(data, tags, strict=True) if written is not None]
            found = object_store.download_object(path)
            assert len(won) == 1, f"{len(won)} of {writers} writers on one condition succeeded: the server keeps none"
            assert found is not None
            assert found[0] == won[0], "what a writer wrote whose condition did not hold is there"
            assert object_store.upload_if_unchanged(path, b"late", None) is None, "If-None-Match is not kept"
            tag = found[1]
    object_store.delete_objects([path])
