"""Choice of panoramas of a facade whose street was captured more than once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import date
from typing import NamedTuple

from catalogs.block.reader import Block
from catalogs.readers.pictures.source_poses import parse_iso_date
from facade_core.plan.plan import Plan

# Panoramas at most that a facade is taken from: more show nothing better, and each must be parsed.
MAX_PANORAMAS = 4
# Of the capture before, by which is told what changed.
MAX_EARLIER_PANORAMAS = 2
# Days without a picture of a facade, at least, between two captures of it.
MIN_DAYS_BETWEEN_CAPTURES = 30


class PanoramasByCapture(NamedTuple):
    """Panoramas of a facade by capture, best first.

    Attributes
    ----------
    newest : of the newest capture, and those without a day.
    before : of the capture before.
    """

    newest: tuple[int, ...]
    before: tuple[int, ...]


def split_panoramas_by_capture(shown: Sequence[int], days: Mapping[int, str]) -> PanoramasByCapture:
    """Split the panoramas of a facade into captures.

    Parameters
    ----------
    shown : panoramas that show it, best first.
    days : day of each, as "2024-05-17".
    """
    numbers = {one: date.fromisoformat(days[one]).toordinal() for one in shown if one in days}
    capture, number, last = {}, 0, None
    for one, day in sorted(numbers.items(), key=lambda item: -item[1]):
        if last is not None and last - day >= MIN_DAYS_BETWEEN_CAPTURES:
            number += 1
        capture[one], last = number, day
    newest = [one for one in shown if capture.get(one, 0) == 0]
    before = [one for one in shown if capture.get(one, 0) == 1]
    return PanoramasByCapture(tuple(newest[:MAX_PANORAMAS]), tuple(before[:MAX_EARLIER_PANORAMAS]))


def facade_panoramas_by_capture(plan: Plan, block: Block) -> list[PanoramasByCapture]:
    """Split the panoramas of each facade by capture."""
    days = {index: day for index, one in enumerate(block.panoramas) if (day := parse_iso_date(one.captured))}
    return [
        split_panoramas_by_capture(plan.sightings.panoramas_showing(facade).tolist(), days)
        for facade in range(len(plan.facades))
    ]
