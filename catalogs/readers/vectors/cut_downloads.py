"""Answers of map servers that hold only a part of what matches, as they state themselves."""

from __future__ import annotations

import re
from pathlib import Path

from catalogs.features import Remark
from facade_core.core.regular_files import open_regular

_END_BYTES = 65_536  # at the beginning and at the end of a file
_EXCEEDED = re.compile(rb'"exceededTransferLimit"\s*:\s*true')  # ArcGIS
_MATCHED = re.compile(rb'"(?:numberMatched|totalFeatures)"\s*:\s*(\d{1,12})')  # WFS, OGC API
_REMEDY = "download the rest by pages and merge the files, or ask for a smaller area"


def note_cut_download(path: Path, row_count: int) -> list[Remark]:
    """Return a remark where a GeoJSON file says that its server cut it off; none for other files.

    Parameters
    ----------
    path : file.
    row_count : number of its features.
    """
    if path.suffix.lower() not in (".geojson", ".json"):
        return []
    with open_regular(path) as file:
        text = file.read(_END_BYTES)
        file.seek(max(len(text), path.stat().st_size - _END_BYTES))
        text += file.read()
    matched = max((int(found) for found in _MATCHED.findall(text)), default=0)
    if matched <= row_count and not _EXCEEDED.search(text):
        return []
    of = f"{row_count} of {matched}" if matched > row_count else f"{row_count}"
    return [Remark(f"{of} in {path.name}", f"features of a download that its server cut at its limit; {_REMEDY}", None)]
