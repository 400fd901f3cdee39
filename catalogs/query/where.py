"""Conditions a user may ask the catalogue: boolean expressions over its columns and nothing else."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any

from facade_core.core.errors import InputError

if TYPE_CHECKING:
    import duckdb

LONGEST = 2000  # characters
FUNCTIONS = ("lower", "upper", "length", "contains", "starts_with", "ends_with", "abs", "round", "least", "greatest")
# Those of them that say yes or no.
_TESTS = {"contains", "starts_with", "ends_with"}
_SIGNS = {"+", "-", "*", "/", "//", "%", "||"}
_LIKES = {"~~": "LIKE", "!~~": "NOT LIKE", "~~*": "ILIKE", "!~~*": "NOT ILIKE"}
_PLAIN = {"CONJUNCTION", "COMPARISON", "BETWEEN", "CONSTANT"}
_OPERATORS = {
    "OPERATOR_NOT",
    "OPERATOR_IS_NULL",
    "OPERATOR_IS_NOT_NULL",
    "OPERATOR_COALESCE",
    "COMPARE_IN",
    "COMPARE_NOT_IN",
}
_QUALIFIERS = ("schema", "catalog", "filter", "distinct", "export_state")


def select_where(connection: duckdb.DuckDBPyConnection, table: str, where: str, columns: Sequence[str]) -> str:
    """The query `SELECT * FROM table WHERE where`, after checking that `where` is one condition over `columns`.

    DuckDB's own parser makes the tree that is checked, and the text that it parsed is the text that is returned, so
    nothing is run that was not looked at. Raises InputError in one line with the remedy.
    """
    query = f"SELECT * FROM {table} WHERE {where}"
    condition = _one_condition(connection, table, where)
    _check(condition, where, columns)
    _check_boolean(condition, where)
    return query


def all_of(conditions: Sequence[str]) -> str | None:
    """The condition that holds where all of some do, None of none. Each is looked at alone before, so that none ends in the
    middle of another. Raises InputError as `select_where`."""
    if len(conditions) < 2:
        return next(iter(conditions), None)
    import duckdb

    with duckdb.connect() as connection:
        for one in conditions:
            _one_condition(connection, "items", one)
    return " AND ".join(f"({one}\n)" for one in conditions)  # a comment ends with its line


def _one_condition(connection: duckdb.DuckDBPyConnection, table: str, where: str) -> Any:
    """What DuckDB's parser makes of a text that is one condition."""
    if not where.strip():
        raise InputError(
            "--where is empty; give a condition such as \"floors >= 5 AND status = 'done'\", or leave it out"
        )
    if len(where) > LONGEST:
        raise InputError(f"--where has {len(where)} characters; at most {LONGEST} are read")
    if where != where.encode(errors="replace").decode():
        raise refusal(where, "it holds half a character", "write it as UTF-8")
    tree = _tree(connection, f"SELECT * FROM {table} WHERE {where}")
    if tree.get("error"):
        problem = tree["error_message"] if tree.get("error_type") == "parser" else "not a condition"
        raise refusal(where, problem, 'give one condition such as "floors >= 5"')
    plain = _tree(connection, f"SELECT * FROM {table} WHERE TRUE")
    condition = _take_condition(tree)
    _take_condition(plain)
    if condition is None or _without_places(tree) != _without_places(plain):
        raise refusal(
            where, "more than a condition", "give one boolean expression; ORDER BY, LIMIT and the like are not read"
        )
    return condition


def named_in(where: str, columns: Sequence[str]) -> list[str]:
    """The columns that a condition names, in its order; what is 'quoted' is text."""
    words = re.findall(r"\w+", re.sub(r"'[^']*'", "", where).lower())
    return [word for word in dict.fromkeys(words) if word in columns]


def parse_since(text: str, now: datetime | None = None) -> datetime:
    """The instant that `text` says: an ISO date or date-time, in UTC unless it has an offset, or an age such as 36h or 7d.

    Ages count back from `now` in minutes (m), hours (h), days (d) or weeks (w). Raises InputError in one line with the remedy.
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


def _tree(connection: duckdb.DuckDBPyConnection, query: str) -> dict[str, Any]:
    import duckdb

    try:
        [(text,)] = connection.execute("SELECT json_serialize_sql(?::VARCHAR)", [query]).fetchall()
        return json.loads(text)
    except (duckdb.Error, RecursionError) as error:
        raise InputError("--where is nested too deeply; give a simpler condition") from error


def _take_condition(tree: dict[str, Any]) -> Any:
    """Cut the condition out of the first statement; None where the statement has no place for one."""
    node = tree["statements"][0]["node"] if tree.get("statements") else {}
    return node.pop("where_clause", None)


def _without_places(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_places(part) for key, part in value.items() if not key.startswith("query_location")}
    return [_without_places(part) for part in value] if isinstance(value, list) else value


def _check(condition: Any, where: str, columns: Sequence[str]) -> None:
    waiting = [condition]
    while waiting:
        part = waiting.pop()
        if isinstance(part, list):
            waiting += part
        elif isinstance(part, dict):
            if "class" in part:
                _check_expression(part, where, columns)
            waiting += part.values()


def _check_boolean(condition: Any, where: str) -> None:
    """DuckDB would take a number for a condition, and 0 for a false one: who writes `floors` alone forgot the rest."""
    waiting = [condition]
    while waiting:
        part = waiting.pop()
        kind, type_ = part["class"], part["type"]
        if kind == "CONJUNCTION" or (kind == "OPERATOR" and type_ in ("OPERATOR_NOT", "OPERATOR_COALESCE")):
            waiting += part["children"]
        elif kind == "COLUMN_REF":
            name = part["column_names"][-1]
            raise refusal(
                where, f"{name} alone is no condition", f'compare it with a value, such as "{name} IS NOT NULL"'
            )
        elif kind == "CONSTANT" and not _is_truth(part):
            raise refusal(where, "a value alone is no condition", 'give one such as "floors >= 5"')
        elif kind == "FUNCTION" and not (part["function_name"].lower() in _TESTS or part["function_name"] in _LIKES):
            problem = f"what {part['function_name']} gives is no condition"
            raise refusal(where, problem, 'compare it with a value, such as "length(street) > 8"')


def _is_truth(constant: dict[str, Any]) -> bool:
    """Whether a constant is TRUE, FALSE or NULL."""
    if "literal" in constant:  # since DuckDB 2
        return constant["literal"]["kind"] in ("BOOLEAN", "NULL_LITERAL")
    return bool(constant["value"]["is_null"]) or constant["value"]["type"]["id"] == "BOOLEAN"


def _check_expression(part: dict[str, Any], where: str, columns: Sequence[str]) -> None:
    kind = part["class"]
    if kind == "COLUMN_REF":
        name = ".".join(part["column_names"])
        if name.lower() not in columns:
            raise refusal(where, f"unknown column {name}", _other_than(name, columns))
    elif kind == "FUNCTION":
        name = part["function_name"].lower()
        known = name in FUNCTIONS or (part.get("is_operator") and (name in _SIGNS or name in _LIKES))
        if not known or any(part.get(qualifier) for qualifier in _QUALIFIERS):
            what = "function" if name.isidentifier() else "operator"
            allowed = FUNCTIONS if what == "function" else ["=", "<>", "<", "<=", ">", ">=", *sorted(_SIGNS)]
            raise refusal(
                where, f"{what} {name} is not allowed here", f"allowed are {', '.join(allowed)}, LIKE and ILIKE"
            )
    elif kind not in _PLAIN and not (kind == "OPERATOR" and part["type"] in _OPERATORS):
        name = part["type"].lower().replace("_", " ")
        raise refusal(where, f"{name} is not allowed here", "compare columns with values, joined by AND, OR and NOT")


def _other_than(name: str, columns: Sequence[str]) -> str:
    """What may have been meant by what is no column."""
    if close := difflib.get_close_matches(name.lower(), columns, n=1, cutoff=0.6):
        return f"did you mean {close[0]}?"
    near = difflib.get_close_matches(name.lower(), columns, n=3, cutoff=0.4)
    others = f"columns with names like it: {', '.join(near)}; " if near else ""
    return f"if it is text, write '{name}', in single quotes; {others}`streetloom query --help` lists all columns"


def refusal(where: str, problem: str, remedy: str) -> InputError:
    """The error for a condition that is not run: the condition, what is wrong with it, and the remedy, in one line."""
    shown = " ".join(where.split())
    shown = shown if len(shown) <= 80 else shown[:77] + "..."
    return InputError(f"--where {shown!r}: {' '.join(problem.split())}; {remedy}")
