"""Record of streets."""

from __future__ import annotations

from facade_core.atlas.journal import Record


class StreetRecord(Record, total=False):
    """Record of a street: its `files` are what its viewpoints decided, one each."""
