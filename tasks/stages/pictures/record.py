"""Records of report pictures."""

from __future__ import annotations

from facade_core.atlas.journal import Record


class ReportPictureRecord(Record, total=False):
    """Record of a view, or of the pictures of a facade.

    Attributes
    ----------
    file : name of the stored file.
    pictures : of a facade: name, title, offset and length of each picture in the file.
    bytes : length of the file.
    digest : digest of the file.
    unread : whether it failed because the store could not be read.
    """

    file: str
    pictures: list[tuple[str, str, int, int]]
    bytes: int
    digest: str
    unread: bool
