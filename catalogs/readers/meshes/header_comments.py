"""Upward axis and unit of a mesh file, as comments at its beginning state them."""

from __future__ import annotations

import re
from pathlib import Path

from facade_core.core.regular_files import open_regular

_HEADER_BYTES = 16_384
_COMMENT = re.compile(r"^(?:#|comment\b)\s*(.*)$", re.MULTILINE)
_UP_AXIS = re.compile(
    r"\bup[\s_-]*(?:axis|vector)?\s*[:=]?\s*\+?([yz])\b|\baxis[\s_-]*up\s*[:=]?\s*\+?([yz])\b|\b([yz])[\s_-]*(?:axis\s*)?(?:is\s*)?up\b",
    re.IGNORECASE,
)
_UNIT = re.compile(r"\bunits?\s*(?:[:=]|is|are|in)\s*([a-z]+)", re.IGNORECASE)
_METRES_PER_UNIT = {
    **dict.fromkeys(("m", "metre", "metres", "meter", "meters"), 1.0),
    **dict.fromkeys(("cm", "centimetre", "centimetres", "centimeter", "centimeters"), 0.01),
    **dict.fromkeys(("mm", "millimetre", "millimetres", "millimeter", "millimeters"), 0.001),
    **dict.fromkeys(("ft", "foot", "feet"), 0.3048),
    **dict.fromkeys(("in", "inch", "inches"), 0.0254),
}


def read_header_comments(path: Path) -> tuple[str | None, float | None]:
    """Return the upward axis and the metres per unit that comments of OBJ or PLY state; None for what they do not.

    Parameters
    ----------
    path : file, whose first comments are read.
    """
    with open_regular(path) as file:
        text = file.read(_HEADER_BYTES).decode("latin-1")
    comments = "\n".join(_COMMENT.findall(text))
    axis, unit = _UP_AXIS.search(comments), _UNIT.search(comments)
    up = next((found.lower() for found in axis.groups() if found), None) if axis else None
    return up, _METRES_PER_UNIT.get(unit[1].lower()) if unit else None
