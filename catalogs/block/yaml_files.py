"""Strict YAML reader whose errors name the line."""

from __future__ import annotations

import re
import stat
import unicodedata
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from facade_core.core.json_types import JsonValue
from facade_core.core.regular_files import open_regular

if TYPE_CHECKING:
    from collections.abc import Hashable

    import yaml

# A block file names data and holds none: with a list of a thousand files it has 100 kB.
MAX_FILE_BYTES = 256_000  # bytes
MAX_NESTING = 20  # levels of keys and lists
# Digits of an integer: no setting is longer, and Python rejects very long ones.
MAX_DIGITS = 40
# Unicode categories that values must not contain: they break lines of messages, or cannot be encoded.
_FORBIDDEN_CATEGORIES = {
    "Cc": "a control character",
    "Cs": "half a character",
    "Zl": "a line break",
    "Zp": "a line break",
}
# Plain scalars of YAML 1.2's core schema. In YAML 1.1 `no` is false, 1:30 is 90 and 010 is 8.
_CORE_SCHEMA = (
    ("null", r"~|null|Null|NULL|", "~nN\0"),
    ("bool", r"true|True|TRUE|false|False|FALSE", "tTfF"),
    ("int", r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+", "-+0123456789"),
    (
        "float",
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
        "-+0123456789.",
    ),
)
_OCTAL = re.compile(r"[-+]?0[0-9]+")
_TAB_PROBLEM = "found character '\\t' that cannot start any token"  # as PyYAML words it
# Key and value without the space between them; not an address such as s3://bucket.
_JOINED_KEY = re.compile(r"\s*(\w+):((?!//)\S+)")


def read_yaml(path: Path) -> JsonValue:
    """Read a YAML file with the YAML 1.2 core schema.

    Anchors, aliases, tags, duplicate keys, files over MAX_FILE_BYTES and nesting over MAX_NESTING are rejected.

    Raises
    ------
    ValueError : one line, with the line number for errors of syntax.
    """
    import yaml

    text = _read_text(path)
    try:
        content: JsonValue = yaml.load(text, Loader=_loader())
        return content
    except yaml.YAMLError as error:
        problem = getattr(error, "problem", None) or getattr(error, "reason", None) or str(error)
        location = _error_location(error, text)
        if problem == _TAB_PROBLEM:
            raise ValueError(f"{location}a tab; indent and separate with spaces") from error
        if joined := _find_joined_key(error, text):
            raise ValueError(joined) from error
        raise ValueError(f"{location}not valid YAML ({' '.join(str(problem).split())}); mend that line") from error


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


class _EventSource(Protocol):
    """Part of a YAML parser that its type stubs leave without types."""

    def peek_event(self) -> yaml.AliasEvent | yaml.ScalarEvent | yaml.CollectionStartEvent:
        """Return the event of the next node."""


def _line_number(part: yaml.Event | yaml.Node) -> int:
    """Return the line where a part of a file begins."""
    assert part.start_mark is not None, "a loader marks all parts"
    return part.start_mark.line + 1


@cache
def _loader() -> type[yaml.SafeLoader]:
    import yaml

    class Loader(yaml.SafeLoader):
        """Strict loader: PyYAML reads YAML 1.1; this one reads the plain scalars of YAML 1.2."""

        depth = 0

        def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
            source: _EventSource = self
            event = source.peek_event()
            line = _line_number(event)
            if isinstance(event, yaml.AliasEvent):
                raise ValueError(f"line {line}: *{event.anchor} stands for another value; write the value out")
            if event.anchor is not None:
                raise ValueError(f"line {line}: &{event.anchor} names a value; leave the name out")
            if event.tag is not None:
                tag = ascii(event.tag.replace("tag:yaml.org,2002:", "!!"))[:60]
                raise ValueError(f"line {line}: {tag} is a tag, and tags are not read; leave it out")
            if self.depth >= MAX_NESTING:
                raise ValueError(f"line {line}: more than {MAX_NESTING} levels of lists or keys; no key takes as many")
            self.depth += 1
            try:
                return super().compose_node(parent, index)
            finally:
                self.depth -= 1

        def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, object]:
            first: dict[str, tuple[int, bool]] = {}
            for key, value in node.value:
                line = _line_number(key)
                if not isinstance(key, yaml.ScalarNode):
                    raise ValueError(f"line {line}: a list or keys in place of a key; write text before the colon")
                holds_keys = isinstance(value, yaml.MappingNode)
                if key.value in first:  # PyYAML silently takes the last one
                    first_line, first_holds_keys = first[key.value]
                    remedy = (
                        f"put the keys of both under one {key.value}"
                        if holds_keys and first_holds_keys
                        else "remove one"
                    )
                    raise ValueError(f"line {line}: {key.value}: given twice (also on line {first_line}); {remedy}")
                first[key.value] = (line, holds_keys)
            return super().construct_mapping(node, deep=deep)

    def construct_text(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> str:
        value = loader.construct_scalar(node)
        for character in value:
            if what := _FORBIDDEN_CATEGORIES.get(unicodedata.category(character)):
                line = _line_number(node)
                raise ValueError(f"line {line}: {ascii(value)[:60]} holds {what}; write it without")
        return str(value)

    def construct_int(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> int:
        value, line = loader.construct_scalar(node), _line_number(node)
        if _OCTAL.fullmatch(value) and value.strip("+-0"):
            plain = value[0].strip("0123456789+") + value.lstrip("+-0")
            raise ValueError(
                f"line {line}: {value[:MAX_DIGITS]} begins with 0, which some read as octal; write {plain[:MAX_DIGITS]}, "
                "or in quotes where it is text"
            )
        if len(value) > MAX_DIGITS:
            raise ValueError(f"line {line}: a number of {len(value)} digits; write one that is meant")
        return int(value, 0) if value[:2] in ("0o", "0x") else int(value)

    def construct_float(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> float:
        value = loader.construct_scalar(node).lower()
        return float(value.replace(".inf", "inf").replace(".nan", "nan"))

    Loader.yaml_implicit_resolvers = {}
    for name, pattern, first in _CORE_SCHEMA:
        tag = f"tag:yaml.org,2002:{name}"
        resolver = (tag, re.compile(rf"(?:{pattern})\Z"))
        for letter in first:
            Loader.yaml_implicit_resolvers.setdefault(letter.strip("\0"), []).append(resolver)
    Loader.add_constructor("tag:yaml.org,2002:str", construct_text)
    Loader.add_constructor("tag:yaml.org,2002:int", construct_int)
    Loader.add_constructor("tag:yaml.org,2002:float", construct_float)
    return Loader
