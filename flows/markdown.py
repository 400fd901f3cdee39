"""Escape data for Markdown, which Prefect's UI expects in every description and table cell."""

from __future__ import annotations

import re
from collections.abc import Mapping

from catalogs.printable_text import escape_invisible

# Starts of emphasis, code, link, tag, entity, table cell or strikethrough; the marks that make an address a link; the marks
# that make a line a heading, list or rule.
_MARKUP = re.compile(
    r"[\\`*\[\]<>|~]|(?<![^\W_])_|_(?![^\W_])|&(?=[#\w])|:(?=//)|@|(?<=www)\.|^\s*[-+=#]|(?<=\d)[.)](?=\s|$)",
    re.IGNORECASE,
)


def escape_markdown(text: str) -> str:
    """Return Markdown that renders as the text itself."""
    return _MARKUP.sub(lambda match: f"{match[0][:-1]}\\{match[0][-1]}", escape_invisible(text))


def markdown_code(text: str) -> str:
    """Return Markdown that renders the text as code."""
    printable = escape_invisible(text)
    fence = "`" * (1 + max(map(len, re.findall("`+", printable)), default=0))
    return f"{fence} {printable} {fence}" if "`" in printable else f"`{printable}`"


def escape_row(row: Mapping[str, object]) -> dict[str, object]:
    """Escape the texts of a table row."""
    return {name: escape_markdown(value) if isinstance(value, str) else value for name, value in row.items()}
