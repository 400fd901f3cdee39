"""Records of report pictures."""

from __future__ import annotations

from typing import cast

from facade_core.atlas.journal import Record
from facade_core.atlas.stored_files import picture_path


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


def picture_file_digests(unit: int, record: Record) -> dict[str, str]:
    """Return the stored file of a picture that is done, path -> digest."""
    picture = cast(ReportPictureRecord, record)
    return {picture_path(picture["file"]): picture["digest"]} if "file" in picture else {}
