"""Crops of photos as taken to the facades of their walls, counted before a plan is made.

The code that makes crops is in their keys and in the key of a run. The code digest of ingest leaves this module out, so that a
change of the parser casts no ray again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

from catalogs.file_digest import file_digest
from facade_core.atlas.journal import unit_key
from facade_core.plan.identity import ParallelMap
from tasks.engine.outcome import collect_input_errors
from tasks.engine.stage_code import stage_code_digest
from tasks.stages.facades.photos import crop_photo_to_wall

# Path of a photo, and width over height of its wall.
PhotoOfWall = tuple[Path, float]


def count_crop_pixels(
    photos: Sequence[PhotoOfWall], parser: Path | None, known: Mapping[str, int], parallel_map: ParallelMap
) -> tuple[list[int], dict[str, int]]:
    """Count the pixels that photos as taken have on their facades; 0 of unusable ones.

    Parameters
    ----------
    photos : the photos.
    parser : model file in place of the shipped one.
    known : counts of earlier ingests by key; these photos are not opened.
    parallel_map : opens the photos.

    Returns
    -------
    counts : count of each photo.
    by_key : the same by a digest of all that each depends on.
    """
    keys = [_crop_key(*photo, parser) for photo in photos]
    new = {key: photo for key, photo in zip(keys, photos, strict=True) if key not in known}
    counted = parallel_map(partial(_count_pixels, parser=parser), list(new.values())) if new else []
    found = {**known, **dict(zip(new, counted, strict=True))}
    by_key = {key: found[key] for key in keys}
    return [by_key[key] for key in keys], by_key


def _crop_key(photo: Path, aspect: float, parser: Path | None) -> str:
    code = stage_code_digest("stages.facades.photos")
    return unit_key(code, file_digest(photo), aspect, "" if parser is None else file_digest(parser))


def _count_pixels(photos: Sequence[PhotoOfWall], parser: Path | None) -> list[int]:
    found = []
    for photo, aspect in photos:
        pixels = 0
        with collect_input_errors([]):
            pixels = crop_photo_to_wall(photo, False, aspect, parser).hidden.size
        found.append(pixels)
    return found
