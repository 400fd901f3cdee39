"""Asking the catalogue: on the command line, and from Python."""

from catalogs.query.execution import query
from catalogs.query.formats import format_items

__all__ = ["format_items", "query"]
