"""Checks of decoded values against the type hints of dataclasses."""

from __future__ import annotations

import types
import typing
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

# Names that modules import for type checkers only.
_GEOMETRY_TYPES = {
    "BaseGeometry": BaseGeometry,
    **{name: getattr(shapely, name) for name in ("LineString", "MultiPolygon", "Polygon")},
}


@cache
def resolve_type_hints(cls: type) -> Mapping[str, object]:
    """Return the type hints of a class by attribute."""
    return typing.get_type_hints(cls, localns=_GEOMETRY_TYPES)


def require_attribute_types(cls: type, values: Mapping[str, object]) -> None:
    """Raise TypeError unless values have the types that a class states for its attributes."""
    hints = resolve_type_hints(cls)
    for name, value in values.items():
        if name in hints and not has_type(value, hints[name]):
            raise TypeError(f"{name} of {cls.__name__} is a {type(value).__name__}")


def has_type(value: object, hint: object) -> bool:
    """Return True where a value has the type of a hint, with all that it contains.

    An int is a float, and a tuple is any sequence. Of arrays the dtype counts.
    """
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if check := _CHECKS.get(origin):
        return check(value, arguments)
    if hint is None or hint is type(None):
        return value is None
    if hint is float:
        return isinstance(value, int | float) and not isinstance(value, bool)
    if hint is int:
        return isinstance(value, int) and not isinstance(value, bool)
    return isinstance(hint, type) and isinstance(value, hint)


def _is_union_member(value: object, arguments: tuple[object, ...]) -> bool:
    return any(has_type(value, hint) for hint in arguments)


def _is_tuple(value: object, arguments: tuple[object, ...]) -> bool:
    if not isinstance(value, tuple):
        return False
    if len(arguments) == 2 and arguments[1] is Ellipsis:
        return all(has_type(part, arguments[0]) for part in value)
    return len(value) == len(arguments) and all(map(has_type, value, arguments))


def _is_mapping(value: object, arguments: tuple[object, ...]) -> bool:
    return isinstance(value, dict) and all(
        has_type(key, arguments[0]) and has_type(part, arguments[1]) for key, part in value.items()
    )


def _is_array(value: object, arguments: tuple[object, ...]) -> bool:
    # NDArray is an alias of its own from NumPy 2.5 on, whose argument is the scalar type
    wanted: Any = (typing.get_args(arguments[-1]) or arguments)[0]
    return isinstance(value, np.ndarray) and value.dtype == np.dtype(wanted)


_CHECKS: Mapping[object, Callable[[object, tuple[object, ...]], bool]] = {
    typing.Union: _is_union_member,
    types.UnionType: _is_union_member,
    typing.Literal: lambda value, arguments: value in arguments,
    tuple: _is_tuple,
    dict: _is_mapping,
    np.ndarray: _is_array,
    typing.get_origin(NDArray[np.float64]): _is_array,
}
