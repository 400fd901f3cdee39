"""Escapes for untrusted text: control characters, line ends and bidirectional marks become visible."""

from __future__ import annotations

import json
import re
import shlex
import unicodedata

# Control and format characters, surrogates, line and paragraph separators.
_INVISIBLE_CATEGORIES = {"Cc", "Cf", "Cs", "Zl", "Zp"}
# Zero-width joiner and non-joiner, which some spellings need.
_JOINERS = "\u200c\u200d"


def normal_form(text: str) -> str:
    """Return a text in NFC, the form in which names and ids are compared: macOS writes file names decomposed."""
    return unicodedata.normalize("NFC", text)


def escape_invisible(text: str) -> str:
    r"""Return a text with Python escapes for invisible characters, such as \x1b, \n and \u202e."""
    if text.isprintable():
        return text
    return "".join(ascii(c)[1:-1] if _is_invisible(c) else c for c in text)


def escape_invisible_json(text: str) -> str:
    """Return equivalent JSON text with JSON escapes for invisible characters.

    Line breaks between values stay.
    """
    if text.replace("\n", "").isprintable():
        return text
    return "".join(json.dumps(c)[1:-1] if c != "\n" and _is_invisible(c) else c for c in text)


def _is_invisible(character: str) -> bool:
    return unicodedata.category(character) in _INVISIBLE_CATEGORIES and character not in _JOINERS


def short_repr(value: object, max_length: int = 60) -> str:
    """Return the repr of a value on one line of at most `max_length` characters."""
    text = " ".join(repr(value).split()) if value is not None else "nothing"
    return text if len(text) <= max_length else text[: max_length - 3] + "..."


def format_command(*words: object) -> str:
    """Return a command of Streetloom as it is typed: words with spaces and the like are quoted."""
    return shlex.join(["streetloom", *map(str, words)])


def format_unit_reason(unit: str, reason: str) -> str:
    """Return a unit and a reason as "unit: reason"; where the reason names the unit first, it says "it" instead."""
    named = re.match(rf"(?:footprint |centreline )?{re.escape(unit)}(: | )", reason)
    rest = reason if named is None else ("" if named[1] == ": " else "it ") + reason[named.end() :]
    return f"{unit}: {rest}"


def format_count(count: int, noun: str) -> str:
    """Return a count and its noun, such as "1 building" and "1,283 buildings"."""
    return f"{count:,} {noun}{'' if count == 1 else 's'}"
