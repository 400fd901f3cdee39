"""Declaration of the keys of a file: what paths, digests, messages and the reference page derive from its model."""

from __future__ import annotations

import types
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from enum import StrEnum
from functools import cache
from typing import Annotated, Literal, TypeGuard, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel, ConfigDict
from pydantic_core import PydanticUndefined

# Defaults of required fields, of dataclasses and of models.
_REQUIRED = (MISSING, PydanticUndefined)
_TYPE_NAMES = {str: "text", bool: "true or false", int: "whole number", float: "number"}


class PathKind(StrEnum):
    """What the path at a key names."""

    FILE = "file"
    RASTER = "raster"
    FOLDER = "folder"
    FILE_OR_FOLDER = "file or folder"

    @property
    def is_file(self) -> bool:
        """Return whether the path must be a file."""
        return self in (PathKind.FILE, PathKind.RASTER)


class Effect(StrEnum):
    """What a changed setting makes pending."""

    PLAN = "the plan, and what it changes"
    UNITS = "units that use it"
    NOTHING = "nothing"


@dataclass(frozen=True)
class Key:
    """Declaration of a key, in the annotation of its type.

    A key is a path (`path`), a setting (`effect`), or says how the files of its section are read (neither): the digest of
    a path and of such a key is that of the content read.

    Attributes
    ----------
    meaning : what it does, for the reference page.
    unit : unit of its value.
    default : text of the default, where the model's own default does not say it.
    path : kind of the path that it holds.
    effect : what a changed value makes pending.
    example : value for the message about a missing one.
    """

    meaning: str
    unit: str = ""
    default: str = ""
    path: PathKind | None = None
    effect: Effect | None = None
    example: str = ""


@dataclass(frozen=True)
class DeclaredKey:
    """Key of a file with its type and default.

    Attributes
    ----------
    name : dotted name, such as `texture.walls`.
    key : its declaration.
    value_type : its type in words, with the range of a number.
    default : the model's default; None also where the key is required.
    is_required : whether its section must hold it.
    is_section : whether it holds keys.
    """

    name: str
    key: Key
    value_type: str
    default: object
    is_required: bool
    is_section: bool


class Section(BaseModel):
    """Keys of a file or of a section: unknown ones are refused, and values are not converted."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


@cache
def declared_keys(model: type) -> Mapping[str, DeclaredKey]:
    """Return the keys of a model and of its sections by dotted name, in the order in which they are declared."""
    return {one.name: one for one in _walk_keys(model, "")}


def stated_value(settings: object, name: str) -> object:
    """Return the value at a dotted key; None where its section is absent."""
    for part in name.split("."):
        settings = None if settings is None else getattr(settings, part)
    return settings


def _walk_keys(model: type, prefix: str) -> Iterator[DeclaredKey]:
    defaults = _defaults(model)
    for name, hint in get_type_hints(model, include_extras=True).items():
        key = next((one for one in _annotations(hint) if isinstance(one, Key)), None)
        if key is None:
            continue
        dotted, default = prefix + name, defaults[name]
        sections = [one for one in _alternatives(hint) if _is_section(one)]
        yield DeclaredKey(
            dotted,
            key,
            "keys" if sections else _type_in_words(hint, key),
            None if default in _REQUIRED else default,
            is_required=default in _REQUIRED,
            is_section=bool(sections),
        )
        for section in sections:
            yield from _walk_keys(section, f"{dotted}.")


def _defaults(model: type) -> dict[str, object]:
    if issubclass(model, BaseModel):
        return {name: field.default for name, field in model.model_fields.items()}
    assert is_dataclass(model)
    return {field.name: field.default for field in fields(model)}


def _is_section(hint: object) -> TypeGuard[type]:
    return isinstance(hint, type) and (issubclass(hint, Section) or is_dataclass(hint))


def _annotations(hint: object) -> tuple[object, ...]:
    return getattr(hint, "__metadata__", ())


def _alternatives(hint: object) -> list[object]:
    """Return the alternatives of a type hint without Optional; annotated ones only where they are bare types."""
    if get_origin(hint) is Annotated:
        return _alternatives(get_args(hint)[0])
    if get_origin(hint) in (Union, types.UnionType):
        return [member for argument in get_args(hint) for member in _alternatives(argument)]
    return [] if hint is type(None) else [hint]


def _type_in_words(hint: object, key: Key) -> str:
    found = [_alternative_in_words(one, key) for one in _annotated_alternatives(hint)]
    return (", or " if "," in found[0] else " or ").join(dict.fromkeys(found))


def _annotated_alternatives(hint: object) -> list[object]:
    """Return the alternatives of a type hint with their annotations."""
    bare = get_args(hint)[0] if get_origin(hint) is Annotated else hint
    if get_origin(bare) in (Union, types.UnionType):
        return [member for argument in get_args(bare) for member in _annotated_alternatives(argument)]
    return [] if bare is type(None) else [hint]


def _alternative_in_words(hint: object, key: Key) -> str:
    bare = get_args(hint)[0] if get_origin(hint) is Annotated else hint
    bounds = _bounds(hint)
    if get_origin(bare) is list:
        [entry] = _annotated_alternatives(get_args(bare)[0])
        noun = _alternative_in_words(entry, key)
        plural = "text" if noun == "text" else f"{noun}s" if "," not in noun else noun.replace(",", "s,", 1)
        return f"list of {bounds['min_length']} {plural}" if "max_length" in bounds else f"list of {plural}"
    if get_origin(bare) is Literal:
        *first, last = (f"`{value}`" for value in get_args(bare))
        return f"{', '.join(first)} or {last}" if first else last
    if bare is str and key.path is not None:
        return str(key.path)
    assert isinstance(bare, type)
    allowed = f", {bounds['ge']:.10g} to {bounds['le']:.10g}" if "ge" in bounds else ""
    return _TYPE_NAMES[bare] + allowed


def _bounds(hint: object) -> dict[str, float]:
    """Return the bounds that the annotations of a type state."""
    names = ("ge", "le", "min_length", "max_length")
    stated = [part for info in _annotations(hint) for part in getattr(info, "metadata", ())]
    return {name: getattr(part, name) for part in stated for name in names if hasattr(part, name)}
