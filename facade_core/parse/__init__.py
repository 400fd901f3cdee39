"""Parsing of rectified facades: classes per pixel, elements, and the irregular rectangular lattice."""

from facade_core.parse.boxes import elements
from facade_core.parse.segmenter import parse
from facade_core.parse.split_lines import lattice

__all__ = ["elements", "lattice", "parse"]
