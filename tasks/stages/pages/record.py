"""Records of pages."""

from __future__ import annotations

from typing import cast

from facade_core.atlas.journal import Record
from facade_core.atlas.stored_files import page_picture_path


class PageRecord(Record, total=False):
    """Record of an encoded page.

    Attributes
    ----------
    bytes : length of the file.
    digest : digest of the file.
    """

    bytes: int
    digest: str


def page_file_digests(unit: int, record: Record) -> dict[str, str]:
    """Return the stored file of a page that is done, path -> digest."""
    return {page_picture_path(unit): cast(PageRecord, record)["digest"]}
