"""Asking the catalogue: on the command line, and from Python."""

from catalogs.query.answers import format_items
from catalogs.query.asking import query

__all__ = ["format_items", "query"]
