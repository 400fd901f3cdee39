"""Parsing of facade pictures."""

from facade_core.parsing.elements import elements
from facade_core.parsing.lattice import lattice
from facade_core.parsing.segmenter import parse

__all__ = ["elements", "lattice", "parse"]
