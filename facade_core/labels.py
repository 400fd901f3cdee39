"""Public import path of the facade classes."""

from facade_core.core.labels import (
    BALCONY,
    CLASSES,
    COLOURS,
    DOOR,
    ELEMENT_CLASSES,
    FLAGS,
    PARSE_COLOURS,
    ROOF,
    SHOP,
    SKY,
    UNKNOWN,
    WALL,
    WINDOW,
    colourise,
)

__all__ = [
    "BALCONY",
    "CLASSES",
    "COLOURS",
    "DOOR",
    "ELEMENT_CLASSES",
    "FLAGS",
    "PARSE_COLOURS",
    "ROOF",
    "SHOP",
    "SKY",
    "UNKNOWN",
    "WALL",
    "WINDOW",
    "colourise",
]
