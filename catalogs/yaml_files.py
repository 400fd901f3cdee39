"""YAML files, read so that every slip in them is named with its line."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def read_yaml(path: Path) -> Any:
    """The content of a YAML file; ValueError in one line, with the line number where YAML itself is at fault."""
    import yaml

    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ValueError("no such block file; check the path") from None
    except OSError as error:
        raise ValueError(f"cannot be read ({error.strerror}); name a block file") from error
    except UnicodeDecodeError:
        raise ValueError("is not UTF-8 text; a block file is YAML") from None
    try:
        _refuse_twins(yaml.compose(text, Loader=yaml.SafeLoader))
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        problem = " ".join(str(getattr(error, "problem", None) or error).split())
        raise ValueError(f"{place}not valid YAML ({problem}); mend that line") from error


def _refuse_twins(root: Any) -> None:
    """YAML lets the last of two equal keys win in silence."""
    import yaml

    waiting, seen = [root], set()
    while waiting:
        node = waiting.pop()
        if id(node) in seen:  # anchors make a graph of it
            continue
        seen.add(id(node))
        if isinstance(node, yaml.SequenceNode):
            waiting += node.value
        elif isinstance(node, yaml.MappingNode):
            lines: dict[str, int] = {}
            for key, value in node.value:
                line = key.start_mark.line + 1
                if isinstance(key, yaml.ScalarNode) and lines.setdefault(key.value, line) != line:
                    raise ValueError(
                        f"line {line}: {key.value}: given twice (also on line {lines[key.value]}); remove one"
                    )
                waiting.append(value)
