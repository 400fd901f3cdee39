"""Facade styles of the shipped library of painted exemplars, by type of building."""

from __future__ import annotations

# The number of a style is its place. A shipped exemplar is named after its style: brick-terrace-03.
FACADE_STYLES = ("perimeter-block", "brick-terrace", "concrete-slab", "villa", "warehouse", "office-glass")
# Number of the style of exemplars that are not of the library.
OTHER_STYLE = -1


def facade_style_number(name: str | None) -> int:
    """Return the number of a style, OTHER_STYLE without one."""
    return FACADE_STYLES.index(name) if name in FACADE_STYLES else OTHER_STYLE
