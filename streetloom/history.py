"""The atlas after any viewpoint of a street."""

from tasks.history import StreetState, after_viewpoint

__all__ = ["StreetState", "after_viewpoint"]
