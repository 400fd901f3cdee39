"""Table of matches between photos and facades, which a person edits or confirms in the viewer."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path

from catalogs.reader_errors import short_message
from facade_core.core.errors import InputError
from facade_core.core.regular_files import read_regular
from facade_core.core.types import Pose

# File name of the table, in the block file's folder.
TABLE = "matches.csv"
# `facade` is empty until a decision, and after the decision (`by`) that no facade matches. x, y, heading: pose of the
# photo by its own metadata, in the block's frame.
COLUMNS = ("photo", "facade", "probability", "candidates", "why", "x", "y", "heading", "by")
# Name for columns without one.
REMARK_COLUMN = "remark"
# Columns of text: spreadsheets run a cell as a formula that begins with one of _FORMULA_STARTS.
_TEXT_COLUMNS = frozenset(("photo", "facade", "candidates", "why", "by"))
_FORMULA_STARTS = ("=", "+", "-", "@")
# Separator of candidates in a cell.
_SEPARATOR = "; "


@dataclass(frozen=True)
class FacadeCandidate:
    """Facade that a photo may show, its probability, and the reasons in one line."""

    facade: str
    probability: float
    why: str


@dataclass(frozen=True)
class PhotoMatch:
    """Row of the match table: one photo, its facade and the candidates.

    Attributes
    ----------
    photo : file name.
    facade : id of the facade; "" if there is none or it is undecided.
    decided_by : who decided in the viewer; "" after an edit of the table or without a decision.
    candidates : most probable first.
    place : position in the block's frame, metres; None if unknown.
    heading : degrees; None if unknown.
    """

    photo: str
    facade: str
    decided_by: str
    candidates: tuple[FacadeCandidate, ...]
    place: tuple[float, float] | None
    heading: float | None

    @property
    def is_decided(self) -> bool:
        """Report whether the table or a person names the result."""
        return bool(self.facade or self.decided_by)


@dataclass(frozen=True)
class MatchTable:
    """Rows of a table file by column, its columns and their separator."""

    path: Path
    columns: tuple[str, ...]
    rows: tuple[Mapping[str, str], ...]
    separator: str = ","

    def matches(self) -> list[PhotoMatch]:
        """Parse the rows that name a photo."""
        return [_parse_match(row) for row in self.rows if row["photo"]]


def format_match_row(
    photo: str, facade: str | None, candidates: Sequence[FacadeCandidate], pose: Pose, *, has_heading: bool
) -> dict[str, str]:
    """Format the result for one photo as a row of the table.

    Parameters
    ----------
    photo : file name.
    facade : id of the facade; None if a person must decide.
    candidates : most probable first.
    pose : pose in the block's frame.
    has_heading : the photo states a heading.
    """
    return {
        "photo": photo,
        "facade": facade or "",
        "probability": f"{candidates[0].probability:.2f}" if candidates else "",
        "candidates": _SEPARATOR.join(f"{one.facade} {one.probability:.2f}" for one in candidates),
        "why": _SEPARATOR.join(one.why for one in candidates),
        "x": f"{pose.x:.2f}",
        "y": f"{pose.y:.2f}",
        "heading": f"{pose.heading:.1f}" if has_heading else "",
        "by": "",
    }


def read_match_table(path: Path) -> MatchTable:
    """Load a table of matches.

    Raises
    ------
    InputError : the file is not such a table.
    """
    try:
        text = read_regular(path).decode("utf-8-sig")
        lines = list(io.StringIO(text, newline=""))  # ends of lines as they are: rewriting keeps them
        # the separator depends on the locale of the spreadsheet
        separator = max(",;\t", key=lines[0].count) if lines else ","
        header, *cells = [tuple(row) for row in csv.reader(lines, delimiter=separator) if row] or [()]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(
            f"{path} cannot be read ({short_message(error)}); give the table that `streetloom match` wrote"
        ) from error
    if not {"photo", "facade"} <= set(header):
        raise InputError(f"{path} has no columns `photo` and `facade`; give the table that `streetloom match` wrote")
    columns = _name_columns(header, cells)
    names = [name for name in columns if name]
    if len(set(names)) < len(names):
        raise InputError(f"{path} has two columns of one name; give each its own")
    known = (*names, *(name for name in COLUMNS if name not in names))
    rows = []
    for row in cells:
        values = {
            name: _unescape_formula(cell.strip()) if name in _TEXT_COLUMNS else cell.strip()
            for name, cell in zip(columns, row, strict=False)
            if name
        }
        rows.append({name: values.get(name, "") for name in known})
    return MatchTable(path, known, tuple(rows), separator)


def _escape_formula(text: str) -> str:
    """Put an apostrophe before a text that a spreadsheet would run as a formula."""
    return f"'{text}" if text.lstrip("'").startswith(_FORMULA_STARTS) else text


def _unescape_formula(text: str) -> str:
    """Return the text that `_escape_formula` got; a text without the apostrophe stays."""
    return text[1:] if text.startswith("'") and text.lstrip("'").startswith(_FORMULA_STARTS) else text


def _name_columns(header: Sequence[str], cells: Sequence[Sequence[str]]) -> list[str]:
    """Name the columns of a table.

    A filled column without a name becomes `remark`, `remark 2`, ..., so that rewriting keeps its text.
    """
    columns = list(header) + [""] * (max(map(len, cells), default=0) - len(header))
    free = (
        name
        for number in count(1)
        if (name := REMARK_COLUMN if number == 1 else f"{REMARK_COLUMN} {number}") not in header
    )
    filled = {index for row in cells for index, cell in enumerate(row) if cell.strip()}
    return [name or (next(free) if index in filled else "") for index, name in enumerate(columns)]


def write_match_table(table: MatchTable, *, new: bool = False) -> None:
    """Write a table atomically.

    Parameters
    ----------
    table : table to write.
    new : refuse to replace an existing file.

    Raises
    ------
    InputError : `new`, and the file was written meanwhile.
    """
    text = io.StringIO(newline="")
    rows = csv.DictWriter(text, table.columns, delimiter=table.separator)
    rows.writeheader()
    rows.writerows(
        {name: _escape_formula(cell) if name in _TEXT_COLUMNS else cell for name, cell in row.items()}
        for row in table.rows
    )
    temporary = table.path.with_name(f".{table.path.name}.{os.getpid()}.tmp")
    temporary.write_text(text.getvalue(), encoding="utf-8", newline="")
    try:
        if new:
            os.link(temporary, table.path)
            temporary.unlink()
        else:
            os.replace(temporary, table.path)
    except FileExistsError:
        temporary.unlink()
        raise InputError(f"{table.path} was written meanwhile; take its photos (--take), or remove it") from None


@dataclass(frozen=True)
class MatchDecision:
    """Decision of a person about one photo.

    Attributes
    ----------
    photo : file name.
    facade : id of the facade that it shows; "" for none of the block.
    is_decided : False restores the undecided row with `facade`.
    previous : facade and author of the row when the person saw it.
    """

    photo: str
    facade: str
    is_decided: bool
    previous: tuple[str, str]


def apply_decisions(table: MatchTable, decisions: Sequence[MatchDecision], *, who: str) -> MatchTable:
    """Return the table with decisions applied.

    Parameters
    ----------
    table : table as read under its lock.
    decisions : at most one for each photo.
    who : author of the decisions.

    Raises
    ------
    InputError : a photo is not in the table, or its row changed meanwhile.
    """
    by_photo = {decision.photo: decision for decision in decisions}
    if missing := set(by_photo) - {row["photo"] for row in table.rows}:
        raise InputError(f"{table.path} has no photo {min(missing)!r} any more; load the page again")
    rows = []
    for row in table.rows:
        decision = by_photo.get(row["photo"])
        if decision is None:
            rows.append(row)
            continue
        if (row["facade"], row["by"]) != decision.previous:
            raise InputError(f"{decision.photo} was decided in {table.path} meanwhile; load the page again and look")
        rows.append({**row, "facade": decision.facade, "by": who if decision.is_decided else ""})
    return replace(table, rows=tuple(rows))


def _parse_match(row: Mapping[str, str]) -> PhotoMatch:
    x, y, heading = (_parse_number(row[name]) for name in ("x", "y", "heading"))
    reasons = row["why"].split(_SEPARATOR)
    candidates = []
    for number, part in enumerate(row["candidates"].split(_SEPARATOR)):
        facade, _, probability = part.rpartition(" ")
        value = _parse_number(probability)
        if facade and value is not None:
            candidates.append(FacadeCandidate(facade, value, reasons[number] if number < len(reasons) else ""))
    place = None if x is None or y is None else (x, y)
    return PhotoMatch(row["photo"], row["facade"], row["by"], tuple(candidates), place, heading)


def _parse_number(text: str) -> float | None:
    """Parse a number in a spreadsheet's notation; None if it is not one."""
    try:
        value = float(text.replace(",", "."))
    except ValueError:
        return None
    return value if abs(value) < 1e9 else None
