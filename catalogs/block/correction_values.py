"""Values of corrections: what each kind may be, checked and normalised."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias, TypeGuard

from catalogs.printable_text import short_repr
from catalogs.reader_errors import short_message
from catalogs.readers.vectors.colours import parse_colour
from facade_core.core.errors import InputError
from facade_core.core.labels import ELEMENT_CLASSES

# Characters of a material or a roof shape.
MAX_WORD_LENGTH = 64

# Left, top, right and bottom as shares of a wall; of an element with its class.
Box: TypeAlias = tuple[float, float, float, float]
ElementBox: TypeAlias = tuple[str, float, float, float, float]


def parse_correction_value(id: object, kind: object, value: object) -> object:
    """Return the value of a correction, normalised; None of a withdrawn one."""
    parse = _VALUE_PARSERS.get(kind) if isinstance(kind, str) else None
    if parse is None:
        raise InputError(f"{short_repr(kind)} is nothing that can be corrected; there is {', '.join(_VALUE_PARSERS)}")
    if not isinstance(id, str) or not id:
        raise InputError("it names no facade or building")
    if value is None:
        return None
    try:
        return parse(value)
    except (TypeError, ValueError, IndexError) as error:
        raise InputError(f"{kind} of {id}: {short_message(error)}") from error


def parse_location(value: object) -> tuple[float, float] | None:
    """Return longitude and latitude; ValueError for another value."""
    if value is None:
        return None
    if isinstance(value, list | tuple) and len(value) == 2 and all(map(is_number, value)):
        return float(value[0]), float(value[1])
    raise ValueError(f"{short_repr(value)} is no place; give longitude and latitude")


def parse_width(value: object) -> float | None:
    """Return the width of a wall in metres; ValueError for another value."""
    if value is None:
        return None
    if not is_number(value) or value <= 0:
        raise ValueError(f"width {short_repr(value)} is no width of a wall; give metres")
    return value


def is_number(value: object) -> TypeGuard[float]:
    """Return whether a JSON value is a finite number."""
    try:
        return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:  # an integer too large for a float
        return False


def _require_list(value: object) -> Sequence[object]:
    if not isinstance(value, list | tuple):
        raise ValueError(f"{short_repr(value)} is no list of boxes")
    return value


def _parse_boxes(value: object) -> tuple[Box, ...]:
    return tuple(_parse_box(box) for box in _require_list(value))


def _parse_box(value: object) -> Box:
    if isinstance(value, list | tuple) and len(value) == 4 and all(map(is_number, value)):
        x0, y0, x1, y1 = (round(min(max(float(v), 0.0), 1.0), 6) for v in value)
        if x0 < x1 and y0 < y1:
            return x0, y0, x1, y1
    raise ValueError(f"{short_repr(value)} is no box within the wall: left, top, right, bottom as shares of it")


def _parse_elements(value: object) -> tuple[ElementBox, ...]:
    found: set[ElementBox] = set()  # duplicates are dropped
    for element in _require_list(value):
        label, *box = element if isinstance(element, list | tuple) and element else (element,)
        if label not in ELEMENT_CLASSES:
            raise ValueError(f"{short_repr(label)} is no element; there is {', '.join(ELEMENT_CLASSES)}")
        found.add((str(label), *_parse_box(box)))
    return tuple(
        sorted(found, key=lambda element: (ELEMENT_CLASSES.index(element[0]), element[2], element[1], element[3:]))
    )


def _parse_flag(value: object) -> bool:
    if not isinstance(value, bool):
        raise ValueError(f"{short_repr(value)} is neither true nor false")
    return value


def _number_parser(minimum: float, maximum: float) -> Callable[[object], float]:
    def parse_number(value: object) -> float:
        if not is_number(value):
            raise ValueError(f"{short_repr(value)} is no number")
        if not minimum <= value <= maximum:
            raise ValueError(f"{value:g} is not within {minimum:g} and {maximum:g}")
        return float(value)

    return parse_number


def _parse_name(value: object) -> str:
    if not isinstance(value, str) or not value:
        raise ValueError(f"{short_repr(value)} is no name")
    return value


def _parse_word(value: object) -> str:
    if not isinstance(value, str) or not value.strip() or len(value) > MAX_WORD_LENGTH:
        raise ValueError(f"{short_repr(value)} is no word for a material or a roof, such as brick")
    return value.strip().lower()


def _parse_colour(value: object) -> str:
    found = parse_colour(value) if isinstance(value, str) else None
    if found is None:
        raise ValueError(f"{short_repr(value)} is no colour; write one as #a0522d")
    return "#{:02x}{:02x}{:02x}".format(*found)


_VALUE_PARSERS: Mapping[str, Callable[[object], object]] = {
    "elements": _parse_elements,
    "hide": _parse_boxes,
    "keep": _parse_boxes,
    "facade": _parse_flag,
    "exemplar": _parse_name,
    "height": _number_parser(2.0, 1000.0),
    "levels": _number_parser(1.0, 300.0),
    "roof_shape": _parse_word,
    "roof_height": _number_parser(0.1, 100.0),
    "wall_material": _parse_word,
    "roof_material": _parse_word,
    "wall_colour": _parse_colour,
    "roof_colour": _parse_colour,
}
