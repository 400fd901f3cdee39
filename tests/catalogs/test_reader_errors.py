"""Messages of refusals: plain words in place of those of Python and its libraries."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from catalogs.reader_errors import short_message
from facade_core.core.errors import InputError

PYTHON_WORDS = (
    "recursion",
    "Error",
    "Exceeds",
    "object has no",
    "unpack",
    "codec",
    "null byte",
    "broadcast",
    "literal",
)


def nest_lists() -> object:
    return json.loads("[" * 200_000)


CASES: dict[str, tuple[Callable[[], object], str]] = {
    "nesting": (nest_lists, "it is nested too deeply"),
    "digits": (lambda: int("9" * 5000), "a number has thousands of digits"),
    "json": (lambda: json.loads('{"a": }'), "expecting value at line 1, column 7"),
    "key": (lambda: {}["faces"], "'faces' is missing"),
    "index": ([].pop, "its content is not arranged as in this format"),
    "type": (lambda: len(None), "its content is not arranged as in this format"),  # type: ignore[arg-type]
    "attribute": (lambda: "a".get("b"), "its content is not arranged as in this format"),  # type: ignore[attr-defined]
    "number": (lambda: float("abc"), "'abc' is no number"),
    "whole": (lambda: int("1.5"), "'1.5' is no whole number"),
    "overflow": (lambda: float(10**400), "a number is too large"),
    "letters": (b"\xff".decode, "it is no UTF-8 text"),
    "null": (lambda: Path("a\0b").stat(), "it holds a null character"),
    "shapes": (lambda: np.zeros(3) + np.zeros(4), "arrays differ in size"),
    "rows": (lambda: np.array([[1], [1, 2]], np.float64), "rows of numbers differ in length"),
    "own": (lambda: (_ for _ in ()).throw(InputError("a: no such key; mend it")), "a: no such key; mend it"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_a_message_says_what_is_wrong_without_words_of_python(case: str) -> None:
    cause, expected = CASES[case]
    with pytest.raises(Exception) as raised:
        cause()
    said = short_message(raised.value)
    assert said == expected
    assert not [word for word in PYTHON_WORDS if word in said]


def test_an_empty_assertion_of_a_library_has_words() -> None:
    assert short_message(AssertionError()) == "its content is not arranged as in this format"
