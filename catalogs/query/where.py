"""Conditions of users on the catalogue: boolean expressions over its columns and nothing else."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject, JsonValue

if TYPE_CHECKING:
    import duckdb

MAX_CONDITION_LENGTH = 2000  # characters
ALLOWED_FUNCTIONS = (
    "lower",
    "upper",
    "length",
    "contains",
    "starts_with",
    "ends_with",
    "abs",
    "round",
    "least",
    "greatest",
)
# Functions among them with a boolean result.
_BOOLEAN_FUNCTIONS = {"contains", "starts_with", "ends_with"}
_ARITHMETIC_OPERATORS = {"+", "-", "*", "/", "//", "%", "||"}
_LIKE_OPERATORS = {"~~": "LIKE", "!~~": "NOT LIKE", "~~*": "ILIKE", "!~~*": "NOT ILIKE"}
_PLAIN_CLASSES = {"CONJUNCTION", "COMPARISON", "BETWEEN", "CONSTANT"}
_OPERATOR_TYPES = {
    "OPERATOR_NOT",
    "OPERATOR_IS_NULL",
    "OPERATOR_IS_NOT_NULL",
    "OPERATOR_COALESCE",
    "COMPARE_IN",
    "COMPARE_NOT_IN",
}
_QUALIFIERS = ("schema", "catalog", "filter", "distinct", "export_state")


def build_checked_select(connection: duckdb.DuckDBPyConnection, table: str, where: str, columns: Sequence[str]) -> str:
    """Return `SELECT * FROM table WHERE where` after checking that `where` is one condition.

    DuckDB's parser builds the tree that is checked, and the parsed text is returned unchanged, so nothing unchecked
    runs.

    Parameters
    ----------
    columns : names that the condition may use.

    Raises
    ------
    InputError : one line with the remedy.
    """
    query = f"SELECT * FROM {table} WHERE {where}"
    condition = _parse_condition(connection, table, where)
    _check_expressions(condition, where, columns)
    _check_boolean(condition, where)
    return query


def combine_conditions(conditions: Sequence[str]) -> str | None:
    """Combine conditions with AND; None without any.

    Each is parsed alone, so that none ends inside another.

    Raises
    ------
    InputError : as `build_checked_select`.
    """
    if len(conditions) < 2:
        return next(iter(conditions), None)
    import duckdb

    with duckdb.connect() as connection:
        for one in conditions:
            _parse_condition(connection, "items", one)
    return " AND ".join(f"({one}\n)" for one in conditions)  # the line break ends a trailing comment


def _parse_condition(connection: duckdb.DuckDBPyConnection, table: str, where: str) -> JsonObject:
    """Parse a text that must be one condition with DuckDB."""
    if not where.strip():
        raise InputError(
            "--where is empty; give a condition such as \"floors >= 5 AND status = 'done'\", or leave it out"
        )
    if len(where) > MAX_CONDITION_LENGTH:
        raise InputError(f"--where has {len(where)} characters; at most {MAX_CONDITION_LENGTH} are read")
    if where != where.encode(errors="replace").decode():
        raise condition_error(where, "it holds half a character", "write it as UTF-8")
    tree = _parse_tree(connection, f"SELECT * FROM {table} WHERE {where}")
    if tree.get("error"):
        problem = tree["error_message"] if tree.get("error_type") == "parser" else "not a condition"
        raise condition_error(where, problem, 'give one condition such as "floors >= 5"')
    plain = _parse_tree(connection, f"SELECT * FROM {table} WHERE TRUE")
    condition = _take_condition(tree)
    _take_condition(plain)
    if condition is None or _strip_locations(tree) != _strip_locations(plain):
        raise condition_error(
            where, "more than a condition", "give one boolean expression; ORDER BY, LIMIT and the like are not read"
        )
    return condition


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


def _parse_tree(connection: duckdb.DuckDBPyConnection, query: str) -> JsonObject:
    import duckdb

    try:
        [(text,)] = connection.execute("SELECT json_serialize_sql(?::VARCHAR)", [query]).fetchall()
        tree: JsonObject = json.loads(text)
        return tree
    except (duckdb.Error, RecursionError) as error:
        raise InputError("--where is nested too deeply; give a simpler condition") from error


def _take_condition(tree: JsonObject) -> JsonObject | None:
    """Cut the condition out of the first statement; None if the statement cannot have one."""
    node = tree["statements"][0]["node"] if tree.get("statements") else {}
    condition: JsonObject | None = node.pop("where_clause", None)
    return condition


def _strip_locations(value: JsonValue) -> JsonValue:
    if isinstance(value, dict):
        return {key: _strip_locations(part) for key, part in value.items() if not key.startswith("query_location")}
    return [_strip_locations(part) for part in value] if isinstance(value, list) else value


def _check_expressions(condition: JsonObject, where: str, columns: Sequence[str]) -> None:
    waiting: list[JsonValue] = [condition]
    while waiting:
        part = waiting.pop()
        if isinstance(part, list):
            waiting += part
        elif isinstance(part, dict):
            if "class" in part:
                _check_expression(part, where, columns)
            waiting += part.values()


def _check_boolean(condition: JsonObject, where: str) -> None:
    """Reject numbers as conditions, which DuckDB accepts: `floors` alone is incomplete."""
    waiting = [condition]
    while waiting:
        part = waiting.pop()
        kind, type_ = part["class"], part["type"]
        if kind == "CONJUNCTION" or (kind == "OPERATOR" and type_ in ("OPERATOR_NOT", "OPERATOR_COALESCE")):
            waiting += part["children"]
        elif kind == "COLUMN_REF":
            name = part["column_names"][-1]
            raise condition_error(
                where, f"{name} alone is no condition", f'compare it with a value, such as "{name} IS NOT NULL"'
            )
        elif kind == "CONSTANT" and not _is_truth(part):
            raise condition_error(where, "a value alone is no condition", 'give one such as "floors >= 5"')
        elif kind == "FUNCTION" and part["function_name"].lower() not in _BOOLEAN_FUNCTIONS.union(_LIKE_OPERATORS):
            problem = f"what {part['function_name']} gives is no condition"
            raise condition_error(where, problem, 'compare it with a value, such as "length(street) > 8"')


def _is_truth(constant: JsonObject) -> bool:
    """Return whether a constant is TRUE, FALSE or NULL."""
    if "literal" in constant:  # since DuckDB 2
        return constant["literal"]["kind"] in ("BOOLEAN", "NULL_LITERAL")
    return bool(constant["value"]["is_null"]) or constant["value"]["type"]["id"] == "BOOLEAN"


def _check_function(part: JsonObject, where: str) -> None:
    name = part["function_name"].lower()
    operators = _ARITHMETIC_OPERATORS.union(_LIKE_OPERATORS) if part.get("is_operator") else ()
    if (name in ALLOWED_FUNCTIONS or name in operators) and not any(map(part.get, _QUALIFIERS)):
        return
    what, allowed = "operator", ["=", "<>", "<", "<=", ">", ">=", *sorted(_ARITHMETIC_OPERATORS)]
    if name.isidentifier():
        what, allowed = "function", [*ALLOWED_FUNCTIONS]
    raise condition_error(
        where, f"{what} {name} is not allowed here", f"allowed are {', '.join(allowed)}, LIKE and ILIKE"
    )


def _check_expression(part: JsonObject, where: str, columns: Sequence[str]) -> None:
    kind = part["class"]
    if kind == "COLUMN_REF":
        name = ".".join(part["column_names"])
        if name.lower() not in columns:
            raise condition_error(where, f"unknown column {name}", _suggest_column(name, columns))
    elif kind == "FUNCTION":
        _check_function(part, where)
    elif kind not in _PLAIN_CLASSES and not (kind == "OPERATOR" and part["type"] in _OPERATOR_TYPES):
        name = part["type"].lower().replace("_", " ")
        raise condition_error(
            where, f"{name} is not allowed here", "compare columns with values, joined by AND, OR and NOT"
        )


def _suggest_column(name: str, columns: Sequence[str]) -> str:
    """Return a suggestion for a name that is no column."""
    if close := difflib.get_close_matches(name.lower(), columns, n=1, cutoff=0.6):
        return f"did you mean {close[0]}?"
    near = difflib.get_close_matches(name.lower(), columns, n=3, cutoff=0.4)
    others = f"columns with names like it: {', '.join(near)}; " if near else ""
    return f"if it is text, write '{name}', in single quotes; {others}`streetloom query --help` lists all columns"


def condition_error(where: str, problem: str, remedy: str) -> InputError:
    """Return the error for a rejected condition: condition, problem and remedy in one line."""
    shown = " ".join(where.split())
    shown = shown if len(shown) <= 80 else shown[:77] + "..."
    return InputError(f"--where {shown!r}: {' '.join(problem.split())}; {remedy}")
