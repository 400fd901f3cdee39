"""Queries of the catalogue, for the command line and for Python."""

from catalogs.query.execution import query
from catalogs.query.formats import format_items

__all__ = ["format_items", "query"]
