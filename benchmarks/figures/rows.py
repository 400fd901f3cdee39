"""The subjects of the page, and how a cell is filled from a record: rows.toml.

In a cell `{record/key/key:spec}` stands for a value of a record. A key may be an item's number, and of a list a
word that this item alone has as a value. spec is Python's, with the nought before a point only where it begins with one (`.2f`
gives .56, `0.2f` 0.56), and may follow on a conversion: `!percent`, or of a list `!count`.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

from benchmarks.figures.records import Record
from facade_core.core.errors import InputError

ROWS = Path(__file__).parent / "rows.toml"
PLACE = re.compile(r"\{([^{}:!]+)(?:!(\w+))?(?::([^{}]*))?\}")
CONVERSIONS: dict[str, Callable[[Any], Any]] = {"percent": lambda value: 100 * value, "count": len}
GOAL = "goal"


@dataclass(frozen=True)
class Measured:
    """A command whose output is kept. timed: its figures are of time or memory, so the load is told; again: its figures do not
    depend on the machine and take seconds, so a test measures them again."""

    command: str
    timed: bool = False
    again: bool = False


@dataclass(frozen=True)
class Subject:
    """A table of the page. columns: heads of the cells after the measure of each row; part: the part of the page that it
    begins; judged: day on which a person judged pictures by eye, which `command` makes, where no record has the figures."""

    title: str
    anchor: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    text: str | None = None
    part: str | None = None
    judged: date | None = None
    command: str | None = None

    @property
    def records(self) -> list[str]:
        """The names of the records that its cells are of, in their order."""
        return list(
            dict.fromkeys(place[1].partition("/")[0] for row in self.rows for place in PLACE.finditer("|".join(row)))
        )


@dataclass(frozen=True)
class Rows:
    subjects: tuple[Subject, ...]
    measured: dict[str, Measured]


def read_rows(path: Path = ROWS) -> Rows:
    """The subjects; InputError where a cell has a number that nothing vouches for, or a subject names no command."""
    tables = tomllib.loads(path.read_text(encoding="utf-8"))
    measured = {name: Measured(**one) for name, one in tables["record"].items()}
    subjects = tuple(
        Subject(
            **one
            | {key: tuple(map(tuple, one["rows"])) if key == "rows" else tuple(one[key]) for key in ("rows", "columns")}
        )
        for one in tables["subject"]
    )
    for subject in subjects:
        where = f"{path.name}, {subject.title}"
        if unknown := [name for name in subject.records if name not in measured]:
            raise InputError(f"{where}: no command for the record {unknown[0]}: add [record.{unknown[0]}]")
        if wrong := [row[0] for row in subject.rows if len(row) != 1 + len(subject.columns)]:
            raise InputError(
                f"{where}, {wrong[0]}: a row has a measure and a cell for each of {', '.join(subject.columns)}"
            )
        cells = [
            cell for row in subject.rows for name, cell in zip(subject.columns, row[1:], strict=True) if name != GOAL
        ]
        if subject.judged is None and any(re.search(r"\d", PLACE.sub("", cell)) for cell in cells):
            raise InputError(f"{where}: numbers are taken out of records, or judged by eye on a day")
        if not subject.records and subject.command is None:
            raise InputError(f"{where}: names neither a record nor a command")
        if [subject.anchor] != [one.anchor for one in subjects if one.anchor == subject.anchor]:
            raise InputError(f"{where}: the anchor {subject.anchor} is another subject's too")
    return Rows(subjects, measured)


def fill_cell(cell: str, records: Mapping[str, Record]) -> str:
    """The text of a cell, with the values of records; InputError where a value is not there."""

    def told(place: re.Match[str]) -> str:
        name, *keys = place[1].split("/")
        try:
            value: Any = records[name].values
            for key in keys:
                value = _step(value, key)
            return _formatted(CONVERSIONS[place[2]](value) if place[2] else value, place[3] or "")
        except (LookupError, TypeError, ValueError) as error:
            raise InputError(f"{place[0]}: {type(error).__name__}: {error}") from None

    return PLACE.sub(told, cell)


def _step(value: Any, key: str) -> Any:
    if isinstance(value, dict):
        return value[key] if key in value or not key.isdecimal() else list(value.values())[int(key)]
    if key.isdecimal():
        return value[int(key)]
    (found,) = [item for item in value if key in item.values()]
    return found


def _formatted(value: Any, spec: str) -> str:
    if isinstance(value, dict | list | bool | None):
        raise TypeError(f"{type(value).__name__} is no figure")
    text = format(value, spec)
    return re.sub(r"^(-?)0\.", r"\1.", text) if spec.startswith(".") else text
