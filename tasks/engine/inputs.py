"""Inputs of units as values: everything that the result of a unit depends on, and the digest of each of them.

The inputs of a unit are a frozen dataclass. Each field is digested by its content: a file by its bytes, an earlier result by
its digest, an object of the block by its shape. The key of a unit follows from these digests and from the code that computes
it, and names the fields that were read: a field that a computation did not look at cannot make its result stale.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import Field, field, fields, is_dataclass
from enum import Enum
from hashlib import blake2b
from pathlib import Path
from typing import Any, Protocol, TypeVar, cast

import numpy as np

from catalogs.file_digest import file_digest
from facade_core.atlas.journal import unit_key

I = TypeVar("I")  # noqa: E741 inputs of a stage

# Digest of the code that computes a unit, beside those of its inputs.
CODE = "code"
# Metadata of a field: why a unit is pending if the field differs, and if it is set for the first time.
_CHANGED, _NEW = "changed", "new"
# Why a unit is pending: texts that several stages use.
CODE_CHANGED = "code or a library changed"
GEOMETRY_CHANGED = "geometry changed"
INPUTS_PENDING = "their inputs are pending"
MODELS_CHANGED = "block's models changed"
PANORAMAS_CHANGED = "panoramas or their poses changed"
PICTURE_CHANGED = "picture changed"
SETTINGS_CHANGED = "block's settings changed"
SURROUNDINGS_CHANGED = "surroundings changed"
VIEW_CHANGED = "visible surfaces changed"
# Characters of a digest in a key.
_LENGTH = 16


class Referenced(Protocol):
    """Protocol of a value that stands for something large: it is digested by a smaller value."""

    def digest_content(self) -> object:
        """Return a smaller value that differs if the content differs."""
        ...


def input_field(changed: str, *, new: str = "", **options: Any) -> Any:
    """Return a dataclass field of inputs.

    Parameters
    ----------
    changed : why a unit is pending if the field differs, as "photo changed".
    new : the same if the field was None or empty.
    options : as of `dataclasses.field`.
    """
    return field(metadata={_CHANGED: changed, _NEW: new or changed}, **options)


def digest_inputs(inputs: object) -> dict[str, str]:
    """Return the digest of each field of a unit's inputs, by name, in order."""
    return {one.name: _digest(getattr(inputs, one.name)) for one in _input_fields(inputs)}


def digest_values(**values: object) -> dict[str, str]:
    """Return the digest of each of some inputs by name."""
    return {name: _digest(value) for name, value in values.items()}


def _digest(value: object) -> str:
    return unit_key(_content(value))[:_LENGTH]


def _content(value: object) -> object:
    """Return a value as strings, numbers and nested lists and dicts of them."""
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if hasattr(value, "digest_content"):  # a check against a protocol takes longer than most digests
        return _content(cast(Referenced, value).digest_content())
    if isinstance(value, Path):
        return [value.name, file_digest(value)]
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, Mapping):
        return [[_content(name), _content(one)] for name, one in sorted(value.items())]
    if isinstance(value, tuple | list):
        return [_content(one) for one in value]
    if isinstance(value, set | frozenset):
        return sorted(_content(one) for one in value)  # type: ignore[type-var]
    if isinstance(value, np.ndarray):
        return [str(value.dtype), list(value.shape), blake2b(np.ascontiguousarray(value).tobytes()).hexdigest()]
    if is_dataclass(value):
        return [_content(getattr(value, one.name)) for one in fields(value)]
    raise TypeError(f"{type(value).__name__} has no digest: give it a method `digest_content`")


class ReadInputs:
    """The inputs of a unit, which note the fields that are read."""

    def __init__(self, inputs: object) -> None:
        self._inputs = inputs
        self._read: set[str] = set()

    def __getattr__(self, name: str) -> object:
        self._read.add(name)
        return getattr(self._inputs, name)


def note_reads(inputs: I) -> tuple[I, set[str]]:
    """Return inputs that note the fields that are read, and the names of these fields as they are noted."""
    noted = ReadInputs(inputs)
    return cast(I, noted), noted._read  # noqa: SLF001


def join_key(digests: Mapping[str, str], read: set[str] | None = None) -> str:
    """Return the key of a unit, from its digests by field with that of its code; only of the fields that were read."""
    return " ".join(f"{name}:{digest}" for name, digest in digests.items() if read is None or name in {CODE, *read})


def split_key(key: str) -> dict[str, str]:
    """Return the digests of a key by field: that of the code first."""
    return dict(part.partition(":")[::2] for part in key.split())


def is_valid_key(key: str, digests: Mapping[str, str]) -> bool:
    """Return whether a result with a key is that of the present inputs: no field that it was computed from differs."""
    return all(digests.get(name) == digest for name, digest in split_key(key).items())


def explain_difference(key: str, inputs: object, digests: Mapping[str, str]) -> str:
    """Return why a unit with a recorded key is pending: the first field that differs."""
    recorded = split_key(key)
    for one in _input_fields(inputs):
        if one.name in recorded and recorded[one.name] != digests[one.name]:
            return str(one.metadata[_NEW if recorded[one.name] in _NOTHING else _CHANGED])
    return CODE_CHANGED


def _input_fields(inputs: object) -> tuple[Field[Any], ...]:
    return tuple(one for one in fields(inputs) if _CHANGED in one.metadata)  # type: ignore[arg-type]


# Digests of a field that is not set.
_NOTHING = {_digest(None), _digest(())}
