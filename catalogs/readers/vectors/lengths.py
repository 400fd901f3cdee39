"""Lengths and floor counts as OpenStreetMap tags write them, with or without a unit."""

from __future__ import annotations

import math
import re

_LENGTH_TEXT = re.compile(
    r"(?:~|≈|ca?\.|ca|circa)?\s*(\d+(?:[.,]\d+)?)"
    r"\s*(mm|cm|m|m\.|metres?|meters?|mètres?|metros?|metri|м|ft|foot|feet|')?",
    re.IGNORECASE,
)
_FEET_INCHES_TEXT = re.compile(
    r"(\d+)\s*(?:'|ft\.?|foot|feet)\s*(\d+(?:[.,]\d+)?)\s*(?:\"|''|in\.?|inch|inches)", re.IGNORECASE
)
_METRES_PER_UNIT = {"mm": 0.001, "cm": 0.01, "ft": 0.3048, "foot": 0.3048, "feet": 0.3048, "'": 0.3048}
# "4 storeys", "3+1" (with an attic), and "G+3" (three over the ground floor).
_FLOORS_TEXT = re.compile(
    r"(\d+(?:[.,]\d+)?)\s*(?:\+\s*(?:\d|a|d|dg|m)?|storeys?|stories|story|floors?|fl\.?|levels?|geschosse?|etagen?|étages?|etages?|plantas?"
    r"|pisos?|piani|piano|verdiepingen|lagen|kerrosta|krs|våningar|etasjer|kondygnacj[ei]|этаж(?:а|ей)?|层|階|층)?",
    re.IGNORECASE,
)
_FLOORS_OVER_GROUND_TEXT = re.compile(r"(?:g|gf|r|rdc|eg|pb|b)\s*\+\s*(\d{1,2})", re.IGNORECASE)
_UNKNOWN_CODE = re.compile(r"-?9{3,}(\.[09]*)?")
FOOT_M = 0.3048  # international foot
_INCH_M = 0.0254


def parse_length(text: str) -> float | None:
    """Return the metres of an OpenStreetMap length: "12", "12.5 m", "~1250 cm", "40 ft", 7'4".

    None for other texts.
    """
    text = text.strip()
    if match := _FEET_INCHES_TEXT.fullmatch(text):
        return _finite_or_none(float(match[1]) * FOOT_M + float(match[2].replace(",", ".")) * _INCH_M)
    if match := _LENGTH_TEXT.fullmatch(text):
        value = float(match[1].replace(",", "."))
        return _finite_or_none(value * _METRES_PER_UNIT.get((match[2] or "").lower(), 1.0))
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
    """Return the floor count of building:levels, such as "5", "3.5", "4 storeys", "3+1" (an attic) and "G+3".

    Of a list such as "4;5" the largest counts; None for other texts.
    """
    counts = [_parse_floors(part.strip()) for part in text.split(";")]
    levels = [count for count in counts if count is not None]
    return max(levels) if len(levels) == len(counts) and 0 < max(levels) < 300 else None


def _parse_floors(text: str) -> float | None:
    if match := _FLOORS_OVER_GROUND_TEXT.fullmatch(text):
        return float(match[1]) + 1.0
    match = _FLOORS_TEXT.fullmatch(text)
    return float(match[1].replace(",", ".")) if match else None
