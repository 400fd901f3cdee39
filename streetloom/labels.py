"""Classes of a facade."""

from facade_core.core.labels import (
    CLASSES,
    COLOURS,
    ELEMENT_CLASSES,
    FLAGS,
    PARSE_COLOURS,
    UNKNOWN,
    FacadeClass,
    colourise,
)

__all__ = [
    "CLASSES",
    "COLOURS",
    "ELEMENT_CLASSES",
    "FLAGS",
    "PARSE_COLOURS",
    "UNKNOWN",
    "FacadeClass",
    "colourise",
]
