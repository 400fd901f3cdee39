"""Variation-factored encoding of facades: element types, structure matrices, levels, one small file."""

from facade_core.variation.encoding import encode
from facade_core.variation.hierarchy import Group, Hierarchy, Level

__all__ = ["Group", "Hierarchy", "Level", "encode"]
