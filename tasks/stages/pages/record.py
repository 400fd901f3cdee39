"""Records of pages."""

from __future__ import annotations

from facade_core.atlas.journal import Record


class PageRecord(Record, total=False):
    """Record of an encoded page.

    Attributes
    ----------
    bytes : length of the file.
    digest : digest of the file.
    """

    bytes: int
    digest: str
