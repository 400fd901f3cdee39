"""Strict YAML reader, and writer: ruamel.yaml with the plain values of YAML 1.2's core schema."""

from __future__ import annotations

import io
import re
import stat
import unicodedata
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from catalogs.printable_text import normal_form
from facade_core.core.json_types import JsonValue
from facade_core.core.regular_files import open_regular

if TYPE_CHECKING:
    from ruamel.yaml import YAML
    from ruamel.yaml.events import Event
    from ruamel.yaml.resolver import BaseResolver

# A block file names data and holds none: with a list of a thousand files it has 100 kB.
MAX_FILE_BYTES = 256_000  # bytes
MAX_NESTING = 20  # levels of keys and lists
# Digits of an integer: no setting is longer, and Python rejects very long ones.
MAX_DIGITS = 40
MAX_LINE_LENGTH = 1_000_000  # of a written file: values are not wrapped
# Unicode categories that values must not contain: they break lines of messages, or cannot be encoded.
_FORBIDDEN_CATEGORIES = {
    "Cc": "a control character",
    "Cs": "half a character",
    "Zl": "a line break",
    "Zp": "a line break",
}
_BACKSLASH_REMEDY = "write paths with / (a backslash in double quotes begins a code)"
# Plain scalars of YAML 1.2's core schema: without dates, underscores and binary numbers.
_CORE_SCHEMA = (
    ("null", r"~|null|Null|NULL|", ("~", "n", "N", "")),
    ("bool", r"true|True|TRUE|false|False|FALSE", tuple("tTfF")),
    ("int", r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+", tuple("-+0123456789")),
    (
        "float",
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
        tuple("-+0123456789."),
    ),
)
_OCTAL = re.compile(r"[-+]?0[0-9]*[1-9][0-9]*")
_LONG_INTEGER = re.compile(rf"[-+]?[0-9]{{{MAX_DIGITS},}}")
# Key and value without the space between them; not an address such as s3://bucket.
_JOINED_KEY = re.compile(r"\s*(\w+):((?!//)\S+)")


def read_yaml(path: Path) -> JsonValue:
    """Read a YAML file with the YAML 1.2 core schema.

    Anchors, aliases, tags, duplicate keys, files over MAX_FILE_BYTES and nesting over MAX_NESTING are rejected.

    Raises
    ------
    ValueError : one line, with the line number for errors of syntax.
    """
    return parse_yaml(normal_form(_read_text(path)))


def parse_yaml(text: str) -> JsonValue:
    """Parse YAML text; raises ValueError as `read_yaml`."""
    from ruamel.yaml.error import YAMLError

    try:
        depth = 0
        for event in _create_yaml().parse(text):
            depth += _depth_change(event)
            _check_event(event, depth)
        content: JsonValue = _create_yaml().load(text)
        return content
    except YAMLError as error:
        problem = " ".join(str(getattr(error, "problem", None) or getattr(error, "reason", None) or error).split())
        if joined := _find_joined_key(error, text):
            raise ValueError(joined) from error
        location = _error_location(error, text)
        if problem.startswith("found duplicate key"):
            problem = re.sub(r' with value "(\{\}|\[\])".*', "", problem)  # the parser shows no value of several lines
            raise ValueError(f"{location}{problem}; keep one, with the keys of both") from error
        remedy = _BACKSLASH_REMEDY if "unknown escape character" in problem else "mend that line"
        raise ValueError(f"{location}not valid YAML ({problem}); {remedy}") from error


def find_key_line(path: Path, location: Sequence[str | int]) -> int | None:
    """Return the line of a key or entry in a file that `read_yaml` reads, or of the last part of its location there."""
    from ruamel.yaml.nodes import MappingNode, SequenceNode

    node, line = _create_yaml().compose(_read_text(path)), None
    for part in location:
        if isinstance(node, MappingNode):
            found = [(key, value) for key, value in node.value if key.value == str(part)]
        elif isinstance(node, SequenceNode) and isinstance(part, int) and part < len(node.value):
            found = [(node.value[part], node.value[part])]
        else:
            break
        if not found:
            break
        key, node = found[0]
        line = key.start_mark.line + 1
    return line


def format_yaml(values: Mapping[str, object]) -> str:
    """Return values as YAML, a key a line in their order."""
    text = io.StringIO()
    yaml = _create_yaml()
    yaml.default_flow_style = False
    yaml.dump(dict(values), text)
    return text.getvalue()


def format_yaml_line(values: Mapping[str, object]) -> str:
    """Return values as YAML on one line, in braces."""
    text = io.StringIO()
    yaml = _create_yaml()
    yaml.default_flow_style = True
    yaml.dump(dict(values), text)
    return text.getvalue().strip()


def _read_text(path: Path) -> str:
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise ValueError("is no file; name a block file")
        with open_regular(path) as file:
            content = file.read(MAX_FILE_BYTES + 1)
    except FileNotFoundError:
        raise ValueError("no such block file; check the path") from None
    except OSError as error:
        raise ValueError(f"cannot be read ({error.strerror}); name a block file") from error
    if len(content) > MAX_FILE_BYTES:
        raise ValueError(
            f"has more than {MAX_FILE_BYTES // 1000} kB, and a block file only names data; name a block file"
        )
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError("is not UTF-8 text; a block file is YAML: save it as UTF-8") from None


def _error_location(error: Exception, text: str) -> str:
    if mark := getattr(error, "problem_mark", None) or getattr(error, "context_mark", None):
        return f"line {mark.line + 1}, column {mark.column + 1}: "
    position = getattr(error, "position", None)  # set for characters that YAML does not allow
    return f"line {text.count(chr(10), 0, position) + 1}: " if isinstance(position, int) else ""


def _find_joined_key(error: Exception, text: str) -> str | None:
    """Return the message for a value that follows its colon at once, on the line of a syntax error or above it."""
    if (mark := getattr(error, "problem_mark", None)) is None:
        return None
    lines = text.splitlines()
    for index in (mark.line, mark.line - 1):
        if 0 <= index < len(lines) and (found := _JOINED_KEY.match(lines[index])):
            key, value = (part[:60] for part in found.groups())
            return f"line {index + 1}: {key}:{value} needs a space after the colon; write {key}: {value}"
    return None


def _create_yaml() -> YAML:
    from ruamel.yaml import YAML

    yaml = YAML(typ="safe", pure=True)
    yaml.Resolver = _core_resolver()
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]  # its class declares None
    yaml.allow_unicode = True
    yaml.width = MAX_LINE_LENGTH
    return yaml


@cache
def _core_resolver() -> type[BaseResolver]:
    from ruamel.yaml.resolver import BaseResolver

    class CoreResolver(BaseResolver):
        """Resolver of the plain scalars of the core schema, whatever version a file states."""

        processing_version = (1, 2)

        def __init__(self, version: object = None, loader: object = None) -> None:
            super().__init__(loader)

    for name, pattern, first in _CORE_SCHEMA:
        tag = f"tag:yaml.org,2002:{name}"
        CoreResolver.add_implicit_resolver_base(tag, re.compile(rf"(?:{pattern})\Z"), first)
    return CoreResolver


def _depth_change(event: Event) -> int:
    from ruamel.yaml.events import CollectionEndEvent, CollectionStartEvent

    return isinstance(event, CollectionStartEvent) - isinstance(event, CollectionEndEvent)


def _check_event(event: Event, depth: int) -> None:
    """Raise ValueError for what block files do not hold, though YAML allows it."""
    from ruamel.yaml.events import AliasEvent, ScalarEvent

    line = f"line {event.start_mark.line + 1}"
    anchor, tag = getattr(event, "anchor", None), getattr(event, "tag", None)
    if isinstance(event, AliasEvent):
        raise ValueError(f"{line}: *{anchor} stands for another value; write the value out")
    if anchor is not None:
        raise ValueError(f"{line}: &{anchor} names a value; leave the name out")
    if tag is not None:
        shown = ascii(str(tag).replace("tag:yaml.org,2002:", "!!"))[:60]
        raise ValueError(f"{line}: {shown} is a tag, and tags are not read; leave it out")
    if depth > MAX_NESTING:
        raise ValueError(f"{line}: more than {MAX_NESTING} levels of lists or keys; no key takes as many")
    if isinstance(event, ScalarEvent):
        _check_scalar(event.value, line, is_plain=event.style is None)


def _check_scalar(value: str, line: str, *, is_plain: bool) -> None:
    for character in value:
        if what := _FORBIDDEN_CATEGORIES.get(unicodedata.category(character)):
            remedy = "write it without" + ("" if is_plain else f", or {_BACKSLASH_REMEDY}")
            raise ValueError(f"{line}: {ascii(value)[:60]} holds {what}; {remedy}")
    if is_plain and _LONG_INTEGER.fullmatch(value):
        raise ValueError(f"{line}: a number of {len(value)} digits; write one that is meant")
    if is_plain and _OCTAL.fullmatch(value):
        plain = value[0].strip("0123456789+") + value.lstrip("+-0")
        raise ValueError(
            f"{line}: {value} begins with 0, which some read as octal; write {plain}, or in quotes where it is text"
        )
