"""`python -m benchmarks.figures` writes docs/figures.md; names of records make them anew before; `--due` lists those of
earlier code."""

from __future__ import annotations

import argparse
import sys

from benchmarks.figures.page import PAGE, current, due, kept
from benchmarks.figures.records import measure, write_record
from benchmarks.figures.rows import read_rows
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
    asked = parser.parse_args()
    rows = read_rows()
    if asked.due:
        records = kept(rows)
        for name, rooms in due(records).items():
            print(f"{name}: measured {records[name].date}; changed since: {', '.join(rooms)}")
        return
    for name in (word for word in asked.words if "=" not in word):
        if name not in rows.measured:
            parser.error(f"{name}: there is {', '.join(rows.measured)}")
        record = measure(rows.measured[name].command, dict(word.split("=", 1) for word in asked.words if "=" in word))
        write_record(name, record)
        print(f"{name}: measured in {record.seconds:.0f} s", file=sys.stderr)
    PAGE.write_text(current(), encoding="utf-8")


if __name__ == "__main__":
    try:
        main()
    except FacadeError as error:
        raise SystemExit(str(error)) from None
