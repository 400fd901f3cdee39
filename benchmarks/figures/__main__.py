"""`python -m benchmarks.figures` writes docs/figures.md; names of records make them anew before; `--due` lists those of
earlier code, and `--night HOURS` makes them anew."""

from __future__ import annotations

import argparse
import sys
import time

from benchmarks.figures.page import PAGE, current, due, kept
from benchmarks.figures.records import measure, write_record
from benchmarks.figures.rows import Rows, read_rows
from facade_core.core.errors import FacadeError


def main() -> None:
    """Write docs/figures.md out of rows and records; make the records that are named anew before."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.figures", description=main.__doc__)
    parser.add_argument(
        "words",
        nargs="*",
        metavar="NAME | DIR=PATH",
        help="records to make anew; what stands for names in their commands",
    )
    parser.add_argument("--due", action="store_true", help="list the records whose code has changed since, and where")
    parser.add_argument(
        "--night", type=float, metavar="HOURS", help="make those of `--due` anew that fit, the quickest first"
    )
    asked = parser.parse_args()
    places = dict(word.split("=", 1) for word in asked.words if "=" in word)
    rows = read_rows()
    if asked.due:
        records = kept(rows)
        for name, rooms in due(records).items():
            print(f"{name}: measured {records[name].date}; changed since: {', '.join(rooms)}")
        return
    for name in (word for word in asked.words if "=" not in word):
        if name not in rows.measured:
            parser.error(f"{name}: there is {', '.join(rows.measured)}")
        _measure_again(name, rows, places)
    if asked.night is not None:
        _measure_due(rows, places, 3600 * asked.night)
    PAGE.write_text(current(), encoding="utf-8")


def _measure_again(name: str, rows: Rows, places: dict[str, str]) -> None:
    record = measure(rows.measured[name].command, places)
    write_record(name, record)
    print(f"{name}: measured in {record.seconds:.0f} s", file=sys.stderr)


def _measure_due(rows: Rows, places: dict[str, str], seconds: float) -> None:
    """Make due records anew, the quickest first; those that fail or do not fit are named."""
    records, begun = kept(rows), time.monotonic()
    for name in sorted(due(records), key=lambda name: records[name].seconds):
        if records[name].seconds > seconds - (time.monotonic() - begun):
            print(f"{name}: left, as it takes {records[name].seconds:.0f} s", file=sys.stderr)
            continue
        try:
            _measure_again(name, rows, places)
        except FacadeError as error:
            print(f"{name}: {error}", file=sys.stderr)


if __name__ == "__main__":
    try:
        main()
    except FacadeError as error:
        raise SystemExit(str(error)) from None
