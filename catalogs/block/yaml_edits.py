"""Add a key to a user's block file without changing its other lines, comments or order."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path

from catalogs.block.yaml_files import format_yaml_line, read_yaml
from facade_core.core.json_types import JsonValue

_IMAGERY_HEADING = re.compile(r"^imagery:[ ]*(#[^\r\n]*)?(?=\r?$)", re.MULTILINE)
_INDENTED_LINE = re.compile(r"^( +)\S", re.MULTILINE)


def format_imagery_entry(kind: str, values: Mapping[str, object]) -> str:
    """Return the line that names pictures of a kind (`panoramas`, `photos`) below `imagery`."""
    return f"{kind}: {format_yaml_line(values)}"


def add_imagery_entry(path: Path, kind: str, values: Mapping[str, object]) -> bool:
    """Add pictures of a kind to a block file that names none.

    Returns
    -------
    False if `imagery` is not written on lines of its own; the file is unchanged then.
    """
    path = path.resolve()  # replacing a link would break it
    before = read_yaml(path)
    if not isinstance(before, dict):
        return False
    text = path.read_bytes().decode()
    end = "\r\n" if "\r\n" in text else "\n"
    line = format_imagery_entry(kind, values)
    if "imagery" not in before:
        new = f"{text.rstrip()}{end}imagery:{end}  {line}{end}"
    elif heading := _IMAGERY_HEADING.search(text):
        child = _INDENTED_LINE.search(text, heading.end())
        indent = child[1] if child else "  "
        new = f"{text[: heading.end()]}{end}{indent}{line}{text[heading.end() :]}"
    else:
        return False
    temporary = path.with_name(f".{path.name}.tmp")
    try:
        temporary.write_bytes(new.encode())
        imagery = {**(before.get("imagery") or {}), kind: dict(values)}
        if _read_or_none(temporary) != {**before, "imagery": imagery}:
            return False
        os.replace(temporary, path)
        return True
    finally:
        temporary.unlink(missing_ok=True)


def _read_or_none(path: Path) -> JsonValue:
    try:
        return read_yaml(path)
    except ValueError:
        return None
