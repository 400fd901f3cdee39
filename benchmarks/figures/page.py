"""docs/figures.md out of the rows and the records."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from benchmarks.figures.code import changed, code_of
from benchmarks.figures.records import Record, read_record
from benchmarks.figures.rows import Measured, Row, Rows, figure_of, read_rows
from tasks.engine.stage_code import ROOT

PAGE = ROOT / "docs" / "figures.md"
NAMED = 3  # rooms
RECORDS = "../benchmarks/figures/records"
HEAD = """# Figures

`make figures` writes this page from the rows and records of `benchmarks/figures/`. A record is the output of a benchmark,
with day, machine, load and digests of the measured code. Measured on 2 cores.

*as of* names the source of a figure:

- a day: a record of that day, with the machine's load where time or memory is measured (2 is all of it).
- every test run: the tests measure it again.
- by hand: entered on that day, before records were kept.
- by eye: judged by a person on that day.

`python -m benchmarks.figures --due` lists the records whose code has changed since, and where.

| what | figure | as of | command |
|---|---|---|---|
"""


def rendered(rows: Rows, records: Mapping[str, Record], changes: Mapping[str, list[str]] | None = None) -> str:
    """The page; with what `due` says, it tells what has changed since of the code of each record."""
    return HEAD + "".join(f"{_line(row, rows, records, changes)}\n" for row in rows.rows)


def current() -> str:
    """The page as the rows and records that are kept have it."""
    rows = read_rows()
    return rendered(rows, kept(rows))


def current_with_changes() -> str:
    """The same, with what has changed since of the code: right for this state of the code alone."""
    rows = read_rows()
    records = kept(rows)
    return rendered(rows, records, due(records))


def kept(rows: Rows) -> dict[str, Record]:
    """The records that rows name."""
    return {name: read_record(name) for name in sorted({name for row in rows.rows for name in row.records})}


def due(records: Mapping[str, Record], root: Path = ROOT) -> dict[str, list[str]]:
    """Of the records whose code is another now: the rooms that changed."""
    found = {name: changed(record.code, code_of(record.command, root)) for name, record in records.items()}
    return {name: rooms for name, rooms in found.items() if rooms}


def _line(row: Row, rows: Rows, records: Mapping[str, Record], changes: Mapping[str, list[str]] | None) -> str:
    commands = [records[name].command for name in row.records] or [str(row.command)]
    of = [_as_of_record(name, rows.measured[name], records[name], changes) for name in row.records]
    if row.by:
        of.append(f"{'the rest ' if of else ''}by {row.by}, {row.of}")
    anchor = f'<a id="{row.anchor}"></a>' if row.anchor else ""
    cells = (
        anchor + row.what,
        figure_of(row, records),
        "; ".join(of),
        ", ".join(f"`{command}`" for command in commands),
    )
    return f"| {' | '.join(cells)} |"


def _as_of_record(name: str, measured: Measured, record: Record, changes: Mapping[str, list[str]] | None) -> str:
    place = f"{RECORDS}/{name}.json"
    if measured.again:
        return f"[every test run]({place})"
    load = f", load {record.load[0]:.0f}" if measured.timed else ""
    if changes is None:
        return f"[{record.date}]({place}){load}"
    rooms = changes.get(name, [])
    if not rooms:
        return f"[{record.date}]({place}){load}, this code"
    more = f" and {len(rooms) - NAMED} more" if len(rooms) > NAMED else ""
    return f"[{record.date}]({place}){load}; changed since: {', '.join(f'`{room}`' for room in rooms[:NAMED])}{more}"
