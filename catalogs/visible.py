"""Text out of data, made safe to look at: what would steer a terminal, end a line or turn the reading direction is shown."""

from __future__ import annotations

import json
import unicodedata
from typing import Any

# Control and format characters, halves of characters, ends of lines and paragraphs.
_INVISIBLE_CATEGORIES = {"Cc", "Cf", "Cs", "Zl", "Zp"}
# Format characters that spelling needs: zero-width joiner and non-joiner.
_JOINERS = "\u200c\u200d"


def escape_invisible(text: str) -> str:
    """The text with every character that is not seen written as Python would write it: \\x1b, \\n, \\u202e."""
    if text.isprintable():
        return text
    return "".join(ascii(c)[1:-1] if _is_invisible(c) else c for c in text)


def escape_invisible_json(text: str) -> str:
    """JSON text that says the same, with those characters written as JSON would; line breaks between values stay."""
    if text.replace("\n", "").isprintable():
        return text
    return "".join(json.dumps(c)[1:-1] if c != "\n" and _is_invisible(c) else c for c in text)


def _is_invisible(character: str) -> bool:
    return unicodedata.category(character) in _INVISIBLE_CATEGORIES and character not in _JOINERS


def short_repr(value: Any, max_length: int = 60) -> str:
    """A value as one short piece of a message."""
    text = " ".join(repr(value).split()) if value is not None else "nothing"
    return text if len(text) <= max_length else text[: max_length - 3] + "..."
