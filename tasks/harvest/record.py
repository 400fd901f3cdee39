"""Records of harvested pictures: what was found in each, in a file of its own, so that no picture is processed twice."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TypedDict

from catalogs.published.folders import write_atomically
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject
from facade_core.core.regular_files import read_regular

# Folders of a style library, below that of the exemplars: none holds pictures itself, or a block would report them.
RECORDS_FOLDER = "harvest/records"
CANDIDATES_FOLDER = "harvest/candidates"
SHEETS_FOLDER = "harvest/sheets"


class CandidateRecord(TypedDict, total=False):
    """Facade that was found in a picture, or the reason why none was.

    Attributes
    ----------
    name : name of the picture's file without suffix, and of a panorama the heading of the view.
    file : name of its files in the folder of candidates, without suffix.
    reason : why it is rejected; missing if it can be used.
    score : 0 to 1.
    parts : parts of the score by name.
    metres_per_pixel, width_m, height_m : scale and size.
    floors, columns : floors, and windows in the fullest row.
    hidden : share that was hidden and is made up.
    look : style descriptor.
    statistics : fields of `FacadeStatistics`.
    """

    name: str
    file: str
    reason: str
    score: float
    parts: dict[str, float]
    metres_per_pixel: float
    width_m: float
    height_m: float
    floors: int
    columns: int
    hidden: float
    look: list[float]
    statistics: JsonObject


class PictureRecord(TypedDict):
    """Result of one picture.

    Attributes
    ----------
    key : digest of all that the result depends on.
    candidates : its facades, by view.
    seconds : seconds that it took.
    looked : whether faces and plates were looked for.
    """

    key: str
    candidates: list[CandidateRecord]
    seconds: float
    looked: bool


def record_path(out: Path, digest: str) -> Path:
    """Return the file of a picture's record, by the digest of the picture."""
    return out / RECORDS_FOLDER / f"{digest[:20]}.json"


def read_picture_record(out: Path, digest: str, key: str) -> PictureRecord | None:
    """Read the record of a picture; None without one of this key, or where files of it are missing."""
    try:
        record: PictureRecord = json.loads(read_regular(record_path(out, digest)))
        if record["key"] != key:
            return None
        files = [out / CANDIDATES_FOLDER / f"{each['file']}.png" for each in record["candidates"]]
    except (OSError, InputError, ValueError, KeyError, TypeError):
        return None  # the picture is processed again
    return record if all(file.is_file() for file in files) else None


def write_picture_record(out: Path, digest: str, record: PictureRecord) -> None:
    """Write the record of a picture, after its files."""
    write_atomically(record_path(out, digest), json.dumps(record, indent=1).encode())
