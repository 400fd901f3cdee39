"""Variation-factored encoding of facades: element types, structure matrices, levels, one small file."""

from facade_core.variation.contents import Group, Level
from facade_core.variation.drawing import draw_level
from facade_core.variation.encoding import coded, encode
from facade_core.variation.hierarchy import Hierarchy
from facade_core.variation.photo import exchange_in_photo
from facade_core.variation.variations import Variations, variations

__all__ = [
    "Group",
    "Hierarchy",
    "Level",
    "Variations",
    "coded",
    "draw_level",
    "encode",
    "exchange_in_photo",
    "variations",
]
