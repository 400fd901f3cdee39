"""Options of texture statements in material libraries of Wavefront OBJ."""

from __future__ import annotations

from dataclasses import dataclass

from facade_core.core.arrays import Float64Array

# Option -> most arguments. -s, -o and -t have one to three numbers.
_ARGUMENT_COUNTS = {"-s": 3, "-o": 3, "-t": 3, "-mm": 2} | dict.fromkeys(
    ("-blendu", "-blendv", "-cc", "-clamp", "-boost", "-bm", "-imfchan", "-texres", "-type", "-colorspace"), 1
)
_NUMERIC_DEFAULTS = {"-s": (1.0, 1.0), "-o": (0.0, 0.0), "-t": (0.0, 0.0)}


@dataclass(frozen=True, slots=True)
class TexturePlacement:
    """Scale and offset of texture coordinates (u, v): options -s and -o."""

    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)

    def apply(self, uv: Float64Array) -> Float64Array:
        """Return the placed coordinates (..., 2)."""
        return uv * self.scale + self.offset


def parse_texture_statement(text: str) -> tuple[str, TexturePlacement]:
    """Return the file name and the placement of a statement such as "-s 2 2 1 -o 0.5 0 my wall.png"."""
    words = text.split()
    numbers: dict[str, tuple[float, float]] = {}
    while len(words) > 1 and words[0].lower() in _ARGUMENT_COUNTS:
        option = words.pop(0).lower()
        values = _take_arguments(words, option)
        if option in _NUMERIC_DEFAULTS and values:
            u, v = (*values, *_NUMERIC_DEFAULTS[option][len(values) :])[:2]
            numbers[option] = (u, v)
    name = text.strip() if len(words) == len(text.split()) else " ".join(words)
    return name, TexturePlacement(numbers.get("-s", (1.0, 1.0)), numbers.get("-o", (0.0, 0.0)))


def _take_arguments(words: list[str], option: str) -> list[float]:
    """Remove the arguments of an option from words, and return them, 0 for text."""
    values: list[float] = []
    for _ in range(_ARGUMENT_COUNTS[option]):
        if len(words) < 2 or ((number := _parse_float(words[0])) is None and option in _NUMERIC_DEFAULTS):
            break
        words.pop(0)
        values.append(number or 0.0)
    return values


def _parse_float(word: str) -> float | None:
    try:
        return float(word)
    except ValueError:
        return None
