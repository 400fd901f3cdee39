"""Lengths and floor counts as OpenStreetMap tags write them, with or without a unit."""

from __future__ import annotations

import math
import re

_LENGTH_TEXT = re.compile(r"(\d+(?:[.,]\d+)?)\s*(m|metres?|meters?|ft|feet|')?", re.IGNORECASE)
_FEET_INCHES_TEXT = re.compile(r"(\d+)\s*'\s*(\d+(?:[.,]\d+)?)\s*(?:\"|'')")
_UNKNOWN_CODE = re.compile(r"-?9{3,}(\.[09]*)?")
FOOT_M = 0.3048  # international foot
_INCH_M = 0.0254


def parse_length(text: str) -> float | None:
    """Return the metres of an OpenStreetMap length: "12", "12.5 m", "40 ft", 7'4".

    None for other texts.
    """
    text = text.strip()
    if match := _FEET_INCHES_TEXT.fullmatch(text):
        return _finite_or_none(float(match[1]) * FOOT_M + float(match[2].replace(",", ".")) * _INCH_M)
    if match := _LENGTH_TEXT.fullmatch(text):
        value = float(match[1].replace(",", "."))
        return _finite_or_none(value * FOOT_M if (match[2] or "").lower() in ("ft", "feet", "'") else value)
    return None


def scale_plain_length(text: str, metres_per_unit: float) -> str:
    """Return a number in metres; a text that is no number, or has a unit, stays."""
    match = _LENGTH_TEXT.fullmatch(text.strip())
    if match is None or match[2]:
        return text
    return f"{float(match[1].replace(',', '.')) * metres_per_unit:.4f}"


def is_unknown_code(text: str) -> bool:
    """Return True for 999, -9999, 99999.0 and the like, which stand for an unknown value."""
    return _UNKNOWN_CODE.fullmatch(text.strip()) is not None


def _finite_or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None


def parse_floor_count(text: str) -> float | None:
    """Return the floor count of building:levels, such as "5" and "3.5".

    Of a list such as "4;5" the largest counts; None for other texts.
    """
    try:
        levels = max(float(part.replace(",", ".")) for part in text.split(";"))
    except ValueError:
        return None
    return levels if 0 < levels < 300 else None
