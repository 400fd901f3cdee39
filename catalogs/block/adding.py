"""A key added to a block file that somebody wrote: its lines, comments and order stay."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import yaml

from catalogs.block.yaml_files import read_yaml

_IMAGERY = re.compile(r"^imagery:[ ]*(#.*)?$", re.MULTILINE)
_CHILD = re.compile(r"^( +)\S", re.MULTILINE)


def panoramas_line(folder: str, poses: str) -> str:
    """What names a folder of panoramas and its poses file below `imagery`."""
    held = yaml.safe_dump({"path": folder, "poses": poses}, default_flow_style=True, allow_unicode=True, width=10**6)
    return f"panoramas: {held.strip()}"


def add_panoramas(path: Path, folder: str, poses: str) -> bool:
    """Have a block file without panoramas name a folder of them; False, and nothing is written, where its `imagery` is not
    written in lines of its own."""
    path = path.resolve()  # of a link, the file that it leads to
    before = read_yaml(path)
    written = path.read_bytes().decode()
    text = written.replace("\r\n", "\n")
    line = panoramas_line(folder, poses)
    if "imagery" not in before:
        new = f"{text.rstrip()}\nimagery:\n  {line}\n"
    elif heading := _IMAGERY.search(text):
        child = _CHILD.search(text, heading.end())
        indent = child[1] if child else "  "
        new = f"{text[: heading.end()]}\n{indent}{line}{text[heading.end() :]}"
    else:
        return False
    temporary = path.with_name(f".{path.name}.tmp")
    try:
        temporary.write_text(new, encoding="utf-8", newline="\r\n" if "\r\n" in written else "\n")
        imagery = {**(before.get("imagery") or {}), **yaml.safe_load(line)}
        if _read(temporary) != {**before, "imagery": imagery}:
            return False
        os.replace(temporary, path)
        return True
    finally:
        temporary.unlink(missing_ok=True)


def _read(path: Path) -> Any:
    try:
        return read_yaml(path)
    except ValueError:
        return None
