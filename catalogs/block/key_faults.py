"""Validation of a block file's values, with one line "key: problem; remedy" for the first fault."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeAlias, TypeVar

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from catalogs.block.declared_keys import DeclaredKey, Section, declared_keys
from catalogs.block.keys import BlockFileSettings
from catalogs.block.paths import list_remedy
from catalogs.block.yaml_files import find_key_line, read_yaml
from catalogs.printable_text import short_repr

S = TypeVar("S", bound=Section)
DeclaredKeys: TypeAlias = Mapping[str, DeclaredKey]

_UNKNOWN_KEY_TYPES = ("extra_forbidden", "unexpected_keyword_argument", "invalid_key")
_SECTION_TYPES = ("model_type", "dataclass_type")
# Keys of city files only.
CITY_KEYS = ("cut", "blocks")
# Characters of an unknown key in a message.
_MAX_KEY_LENGTH = 60


class KeyFaultError(ValueError):
    """Fault of a key: one line "key: problem; remedy", and where the key stands."""

    def __init__(self, message: str, location: tuple[str | int, ...]) -> None:
        super().__init__(message)
        self.location = location


def read_block_settings(path: Path) -> BlockFileSettings:
    """Read and validate the keys of a block file.

    Raises
    ------
    ValueError : one line "line N: key: problem; remedy" for the first fault.
    """
    try:
        return validate_block_settings(read_yaml(path))
    except KeyFaultError as error:
        line = find_key_line(path, error.location)
        raise ValueError(str(error) if line is None else f"line {line}: {error}") from None


def validate_block_settings(values: object) -> BlockFileSettings:
    """Validate the content of a block file, and return its settings.

    Raises
    ------
    ValueError : one line "key: problem; remedy" for the first fault.
    """
    if not isinstance(values, Mapping):
        raise ValueError("holds no keys; write at least name and buildings")
    return validate_section(BlockFileSettings, values)


def validate_section(model: type[S], values: Mapping[str, object]) -> S:
    """Validate values by the model of their keys; raises ValueError as `validate_block_settings`."""
    try:
        return model.model_validate(values)
    except ValidationError as error:
        # A mistyped key is also reported as a missing one: the unknown key comes first.
        faults = sorted(error.errors(include_url=False), key=lambda fault: fault["type"] not in _UNKNOWN_KEY_TYPES)
        raise KeyFaultError(_format_fault(faults[0], declared_keys(model)), faults[0]["loc"]) from None


def _format_fault(fault: ErrorDetails, known: DeclaredKeys) -> str:
    kind, value = fault["type"], fault["input"]
    key = str(fault["loc"][-1]) if kind == "invalid_key" else format_dotted_key(fault["loc"], known)
    if kind in _UNKNOWN_KEY_TYPES:
        return _format_unknown_key(key, known)
    declared = known.get(key.partition("[")[0])
    if kind == "missing" and declared is not None:
        leaf = key.rpartition(".")[2]
        return f"{key}: missing; write {leaf}: {declared.key.example or str(declared.key.path).upper()}"
    if kind in _SECTION_TYPES:
        return _format_text_for_keys(key, value, known)
    if value is None or value == "":
        return f"{key}: is empty; fill it in, or remove the key"
    problem, shown = fault["msg"].removeprefix("Value error, "), short_repr(value)
    if kind == "value_error" or declared is None:
        return f"{key}: {problem}, got {shown}"
    if declared.key.path is not None and (paths := _listed_paths(value)):
        if declared.key.path.is_file:
            return f"{key}: {shown} is a list where one file is read; {list_remedy(key, paths)}"
        return f"{key}: {shown} is a list where one folder is read; put their files into one folder"
    if "[" in key or isinstance(value, list):
        return f"{key}: {shown}: {problem}; write a {declared.value_type}"
    return f"{key}: {shown} is not {_with_article(declared.value_type)}{_quotes_remedy(value, declared)}"


def _listed_paths(value: object) -> list[str]:
    """Return the paths of a list, plain or under a key `path`, cut to what a message can show."""
    listed = [one.get("path") if isinstance(one, dict) else one for one in value] if isinstance(value, list) else []
    return [one[-_MAX_KEY_LENGTH:] for one in listed if isinstance(one, str)]


def _with_article(value_type: str) -> str:
    return f"a {value_type}" if value_type.startswith(("number", "whole", "file", "folder")) else value_type


def _quotes_remedy(value: object, declared: DeclaredKey) -> str:
    if isinstance(value, str):
        return "; write it in digits, without quotes" if "number" in declared.value_type else ""
    return "; write it in quotes" if declared.value_type == "text" else ""


def _format_unknown_key(key: str, known: DeclaredKeys) -> str:
    if key in CITY_KEYS:
        return f"{key}: is a key of a city, and this is to be one block; run it with `streetloom city`"
    shown = key if len(key) <= _MAX_KEY_LENGTH else key[: _MAX_KEY_LENGTH - 3] + "..."
    return (
        _describe_joined_key(key, shown, known) or f"{shown}: unknown key; {_suggest_key(key[:_MAX_KEY_LENGTH], known)}"
    )


def _format_text_for_keys(key: str, value: object, known: DeclaredKeys) -> str:
    """Return the message for a value in place of the keys of a section."""
    if isinstance(value, str) and (joined := _describe_joined_key(f"{key}.{value}", short_repr(value), known)):
        return f"{key}: {joined}"
    if f"{key}.path" in known and (paths := _listed_paths(value)):
        return f"{key}: holds a list where keys are expected; {list_remedy(f'{key}.path', paths)}"
    inner = [name.removeprefix(f"{key}.") for name in known if name.startswith(f"{key}.")]
    is_path = "path" in inner and isinstance(value, str)
    example = f"path: {' '.join(str(value).split())[:_MAX_KEY_LENGTH]}" if is_path else f"{inner[0]}: ..."
    return f"{key}: holds {short_repr(value)} where keys are expected; write {key}: {{{example}}}"


def format_dotted_key(loc: Sequence[str | int], known: DeclaredKeys) -> str:
    """Format the location of a fault as a dotted key: ("area", 1) -> area[1]; ("texture", "walls") -> texture.walls."""
    key = ""
    for part in loc:
        if isinstance(part, int):
            key += f"[{part}]"
        elif key not in known or known[key].is_section:  # else pydantic names the alternative that it tried
            key = f"{key}.{part}".lstrip(".")
    return key


def _describe_joined_key(text: str, shown: str, known: DeclaredKeys) -> str | None:
    """Return the message for a known key and its value without a space between them."""
    key, _, value = text.partition(":")
    if key not in known or not value:
        return None
    return f"{shown} needs a space after the colon; write {key.rpartition('.')[2]}: {value[:_MAX_KEY_LENGTH]}"


def _suggest_key(key: str, known: DeclaredKeys) -> str:
    parent, _, leaf = key.rpartition(".")
    siblings = {name.rpartition(".")[2]: name for name in known if name.rpartition(".")[0] == parent}
    leaves = {name.rpartition(".")[2]: name for name in known}
    for candidates in (siblings, leaves):
        # the same key at another level comes before a similar one
        if close := difflib.get_close_matches(leaf.lower(), candidates, n=1, cutoff=0.7):
            return f"did you mean {candidates[close[0]]}?"
    return f"known here are {', '.join(siblings) or 'none'}"
