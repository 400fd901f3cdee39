"""Conditions of users on the catalogue: boolean expressions over its columns and nothing else."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

from facade_core.core.errors import InputError

if TYPE_CHECKING:
    from duckdb import DuckDBPyConnection, DuckDBPyRelation

_UNKNOWN_COLUMN = re.compile(r'does not contain column "?(.+?)"? referenced')


def filter_rows(connection: DuckDBPyConnection, rows: DuckDBPyRelation, where: str) -> DuckDBPyRelation:
    """Return the rows that a condition selects, in a database whose configuration is locked.

    DuckDB itself refuses anything but one expression: the condition must be a CHECK constraint of a table with the same
    columns, which has no subquery, aggregate, window or table function, and must be parsed as an expression by itself.

    Raises
    ------
    InputError : one line with the remedy.
    """
    import duckdb

    condition = where.strip().rstrip("; ")
    if not condition:
        raise InputError(
            "--where is empty; give a condition such as \"floors >= 5 AND status = 'done'\", or leave it out"
        )
    if where != where.encode(errors="replace").decode():
        raise condition_error(where, "it holds half a character", "write it as UTF-8")
    columns = ", ".join(f"{quote_name(name)} {type_}" for name, type_ in zip(rows.columns, rows.types, strict=True))
    try:
        connection.execute(f"CREATE OR REPLACE TEMP TABLE checked ({columns}, CHECK (\n{condition}\n))")
        (result_type,) = rows.project(condition).types
        found = rows.filter(condition)
    except duckdb.Error as error:
        raise explain_refusal(where, error, rows.columns) from error
    if str(result_type).strip('"') not in ("BOOLEAN", "NULL"):
        raise condition_error(
            where, f"what it gives is no condition but {result_type}", 'compare it with a value, such as "floors >= 5"'
        )
    return found


def explain_refusal(where: str, error: Exception, columns: Sequence[str]) -> InputError:
    """Return the error for a condition that DuckDB refuses."""
    if unknown := _UNKNOWN_COLUMN.search(str(error)):
        return condition_error(where, f"unknown column {unknown[1]}", _suggest_column(unknown[1], columns))
    problem = str(error).splitlines()[0].partition(": ")[2].partition(" You might")[0]
    return condition_error(where, problem, 'give one condition over the columns, such as "floors >= 5"')


def quote_name(column: str) -> str:
    """Return the name of a column in SQL."""
    return '"' + column.replace('"', '""') + '"'


def condition_columns(where: str, columns: Sequence[str]) -> list[str]:
    """Return the columns that a condition names, in its order; 'quoted' text is skipped."""
    words = re.findall(r"\w+", re.sub(r"'[^']*'", "", where).lower())
    return [word for word in dict.fromkeys(words) if word in columns]


def parse_since(text: str, now: datetime | None = None) -> datetime:
    """Parse an ISO date or date-time, or an age such as 36h or 7d, as an instant.

    Dates are in UTC unless they have an offset. Ages count back from `now` in minutes (m), hours (h), days (d) or
    weeks (w).

    Raises
    ------
    InputError : one line with the remedy.
    """
    try:
        if age := re.fullmatch(r"(\d+)([mhdw])", text.strip()):
            unit = {"m": "minutes", "h": "hours", "d": "days", "w": "weeks"}[age[2]]
            return (now or datetime.now(UTC)) - timedelta(**{unit: int(age[1])})
        instant = datetime.fromisoformat(text.strip())
        return (instant if instant.tzinfo else instant.replace(tzinfo=UTC)).astimezone(UTC)
    except (ValueError, OverflowError) as error:
        raise InputError(
            f"--since {text!r}: not a time; give a date such as 2026-11-21 or 2026-11-21T18:00+02:00, "
            "or an age such as 36h or 7d"
        ) from error


def _suggest_column(name: str, columns: Sequence[str]) -> str:
    """Return a suggestion for a name that is no column."""
    if close := difflib.get_close_matches(name.lower(), columns, n=1, cutoff=0.6):
        return f"did you mean {close[0]}?"
    near = difflib.get_close_matches(name.lower(), columns, n=3, cutoff=0.4)
    others = f"columns with names like it: {', '.join(near)}; " if near else ""
    return f"if it is text, write '{name}', in single quotes; {others}`streetloom query --help` lists all columns"


def condition_error(where: str, problem: str, remedy: str) -> InputError:
    """Return the error for a rejected condition: condition, problem and remedy in one line."""
    shown, problem = (" ".join(text.split()) for text in (where, problem))
    shown = shown if len(shown) <= 80 else shown[:77] + "..."
    return InputError(f"--where {shown!r}: {problem[:200]}; {remedy}")
