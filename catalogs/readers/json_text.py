"""JSON parser with error messages that name the defect."""

from __future__ import annotations

import json
from pathlib import Path

from catalogs.reader_errors import short_message
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject, JsonValue
from facade_core.core.regular_files import open_regular

_MAX_WORD_LENGTH = len("-Infinity")


def is_json_lines(path: Path) -> bool:
    """Return True where a file is a sequence of JSON texts, one per line.

    Raises
    ------
    InputError
        Where the file cannot be opened.
    """
    if path.suffix.lower() == ".jsonl":
        return True
    try:
        with open_regular(path) as file:
            first, second = file.readline().strip(), file.readline().strip()
    except OSError as error:
        raise InputError(f"{path} cannot be opened ({error.strerror}); check the path") from error
    return first.startswith(b"{") and first.endswith(b"}") and second.startswith(b"{")


def load_json(path: Path, max_bytes: int | None = None) -> JsonValue:
    """Load a JSON file; NaN and Infinity are accepted.

    Parameters
    ----------
    path : file.
    max_bytes : largest accepted size; None: any.

    Raises
    ------
    InputError
        Where the file cannot be read.
    """
    try:
        with open_regular(path, max_bytes) as file:
            text = file.read()
    except OSError as error:
        raise InputError(f"{path} cannot be opened ({error.strerror}); check the path") from error
    return parse_json(text, str(path))


def parse_json_object(text: bytes, where: str) -> JsonObject:
    """Parse a JSON text that is an object; see `parse_json`.

    Raises
    ------
    InputError
        One line that begins with `where`, for an invalid text or another value.
    """
    return _require_object(parse_json(text, where), where)


def _require_object(value: JsonValue, where: str) -> JsonObject:
    if not isinstance(value, dict):
        raise InputError(f"{where} holds no JSON object, which begins with {{; export it anew")
    return value


def parse_json(text: bytes, where: str) -> JsonValue:
    """Parse a JSON text.

    Raises
    ------
    InputError
        One line that begins with `where`, for a truncated or invalid text.
    """
    if not text.strip(b"\0\t\n\r \xef\xbb\xbf"):
        raise InputError(f"{where} is empty; get the file again")
    try:
        value: JsonValue = json.loads(text)
        return value
    except json.JSONDecodeError as error:
        # A truncated text fails at its end, or in the word or string at its end.
        if error.pos and (
            error.msg.startswith("Unterminated") or len(error.doc.rstrip()) - error.pos <= _MAX_WORD_LENGTH
        ):
            raise InputError(
                f"{where} is truncated: the JSON breaks off at line {error.lineno}; get it again"
            ) from error
        place = f"line {error.lineno}, column {error.colno}"
        raise InputError(
            f"{where} is not JSON: {error.msg.lower()} at {place}; mend it there or export it anew"
        ) from error
    except UnicodeDecodeError as error:
        what = "is truncated within a letter; get it" if error.start >= len(text) - 3 else "is no UTF-8 text; export it"
        raise InputError(f"{where} {what} again") from error
    except (RecursionError, ValueError) as error:  # ValueError: a number of thousands of digits
        raise InputError(f"{where} is not usable JSON ({short_message(error)}); export it anew") from error
