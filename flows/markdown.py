"""Text out of data as Markdown that shows just this text: Prefect's UI takes every description and table cell for Markdown."""

from __future__ import annotations

import re
from typing import Any

from catalogs.printable_text import escape_invisible

# What begins emphasis, code, a link, a tag, an entity, a table's cell or a line through; what makes an address a link; what
# makes a line a heading, a list or a rule.
_MARKUP = re.compile(
    r"[\\`*\[\]<>|~]|(?<![^\W_])_|_(?![^\W_])|&(?=[#\w])|:(?=//)|@|(?<=www)\.|^\s*[-+=#]|(?<=\d)[.)](?=\s|$)",
    re.IGNORECASE,
)


def escape_markdown(text: str) -> str:
    """Markdown for the text itself."""
    return _MARKUP.sub(lambda found: f"{found[0][:-1]}\\{found[0][-1]}", escape_invisible(text))


def markdown_code(text: str) -> str:
    """Markdown for the text as code."""
    shown = escape_invisible(text)
    fence = "`" * (1 + max(map(len, re.findall("`+", shown)), default=0))
    return f"{fence} {shown} {fence}" if "`" in shown else f"`{shown}`"


def escape_row(row: dict[str, Any]) -> dict[str, Any]:
    """A table's row with its texts as Markdown."""
    return {name: escape_markdown(value) if isinstance(value, str) else value for name, value in row.items()}
