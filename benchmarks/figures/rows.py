"""The rows of the page, and how a figure is taken out of a record: rows.toml.

In the text of a figure `{record/key/key:spec}` stands for a value of a record. A key may be an item's number, and of a list a
word that this item alone has as a value. spec is Python's, with the nought before a point only where it begins with one (`.2f`
gives .56, `0.2f` 0.56), and may follow on a conversion: `!percent`, `!kilo`, `!mega`, or of a list `!min`, `!max`, `!median`,
`!mean`, `!count`, `!sum`.
"""

from __future__ import annotations

import re
import statistics
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
CONVERSIONS: dict[str, Callable[[Any], Any]] = {
    "percent": lambda value: 100 * value,
    "kilo": lambda value: value / 1e3,
    "mega": lambda value: value / 1e6,
    "min": min,
    "max": max,
    "median": statistics.median,
    "mean": statistics.fmean,
    "count": len,
    "sum": sum,
}
BY = ("hand", "eye")


@dataclass(frozen=True)
class Measured:
    """A command whose output is kept. timed: its figures are of time or memory, so the load is told; again: its figures do not
    depend on the machine and take seconds, so a test measures them again."""

    command: str
    timed: bool = False
    again: bool = False


@dataclass(frozen=True)
class Row:
    """what: what is measured; figure: text with places for values. by: whether what is of no record was carried over by hand or
    judged by eye, `of` which day; command: what measures it, where no record of it is there; anchor: where links to it lead."""

    what: str
    figure: str
    by: str | None = None
    of: date | None = None
    command: str | None = None
    anchor: str | None = None

    @property
    def records(self) -> list[str]:
        """The names of the records that its figures are of, in their order."""
        return list(dict.fromkeys(place[1].partition("/")[0] for place in PLACE.finditer(self.figure)))


@dataclass(frozen=True)
class Rows:
    rows: tuple[Row, ...]
    measured: dict[str, Measured]


def read_rows(path: Path = ROWS) -> Rows:
    """The rows; InputError where one has numbers that nothing vouches for, or names no command."""
    said = tomllib.loads(path.read_text(encoding="utf-8"))
    measured = {name: Measured(**one) for name, one in said["record"].items()}
    rows = tuple(Row(**one) for one in said["row"])
    for row in rows:
        if unknown := [name for name in row.records if name not in measured]:
            raise InputError(
                f"{path.name}, {row.what}: no command for the record {unknown[0]}: add [record.{unknown[0]}]"
            )
        typed = re.search(r"\b\d+\b", PLACE.sub("", row.figure))  # not that of F1 or 3D
        if (row.by is None) != (row.of is None) or row.by not in (None, *BY):
            raise InputError(f"{path.name}, {row.what}: by is {' or '.join(BY)}, and of a day")
        if typed and row.by is None:
            raise InputError(
                f"{path.name}, {row.what}: numbers are taken out of records, or the row says by whom they are"
            )
        if not row.records and row.command is None:
            raise InputError(f"{path.name}, {row.what}: names neither a record nor a command")
        if row.anchor and [row.anchor] != [one.anchor for one in rows if one.anchor == row.anchor]:
            raise InputError(f"{path.name}, {row.what}: the anchor {row.anchor} is another row's too")
    return Rows(rows, measured)


def figure_of(row: Row, records: Mapping[str, Record]) -> str:
    """The text of a row's figure, with the values of records; InputError where a value is not there."""

    def told(place: re.Match[str]) -> str:
        name, *keys = place[1].split("/")
        try:
            value: Any = records[name].values
            for key in keys:
                value = _step(value, key)
            return _formatted(CONVERSIONS[place[2]](value) if place[2] else value, place[3] or "")
        except (LookupError, TypeError, ValueError) as error:
            raise InputError(f"{row.what}: {place[0]}: {type(error).__name__}: {error}") from None

    return PLACE.sub(told, row.figure)


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
