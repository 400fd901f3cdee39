"""docs/figures.md out of the rows and the records."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from benchmarks.figures.code import changed, code_of
from benchmarks.figures.records import Record, read_record
from benchmarks.figures.rows import GOAL, Measured, Rows, Subject, fill_cell, read_rows
from tasks.engine.stage_code import ROOT

PAGE = ROOT / "docs" / "figures.md"
BEST: dict[str, Callable[[Iterable[float]], float]] = {"↑": max, "↓": min}
RECORDS = "../benchmarks/figures/records"
HEAD = """# Figures

Each table has one subject, each row one measure. *Goal* is what the project wants; other columns are other methods on the same
data. ↑ means that more is better, ↓ that less is. The best figure of such a row is **bold**, also where it is not ours.

- Measured on 2 cores of a server (x86-64) without a graphics card. *Load* counts other processes at work.
- *Held-out* or *unseen* data was used neither for training nor for settings.
- *Painted* streets are computer-made, so that the truth is known.
- ECP, CMP, Art-Deco and LabelMeFacade are collections of labelled facade photographs.
- PSNR (dB) and SSIM compare with the true picture; IoU and F1 compare areas and objects with marked ones.

`make figures` writes this page from `benchmarks/figures/`; `python -m benchmarks.figures --due` lists what to measure again.
"""


def rendered(rows: Rows, records: Mapping[str, Record], changes: Mapping[str, list[str]] | None = None) -> str:
    """The page; with what `due` says, it tells what has changed since of the code of each record."""
    return HEAD + "".join(f"\n{_section(subject, rows, records, changes)}" for subject in rows.subjects)


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
    """The records that subjects name."""
    return {name: read_record(name) for name in sorted({name for subject in rows.subjects for name in subject.records})}


def due(records: Mapping[str, Record], root: Path = ROOT) -> dict[str, list[str]]:
    """Of the records whose code is another now: the rooms that changed."""
    found = {name: changed(record.code, code_of(record.command, root)) for name, record in records.items()}
    return {name: rooms for name, rooms in found.items() if rooms}


def _section(
    subject: Subject, rows: Rows, records: Mapping[str, Record], changes: Mapping[str, list[str]] | None
) -> str:
    sources = [
        f"{_as_of_record(name, rows.measured[name], records[name], changes)}: `{records[name].command}`"
        for name in subject.records
    ]
    if subject.judged:
        sources.append(f"by eye, {subject.judged}: `{subject.command}`")
    lines = [["measure", *subject.columns], ["-"] * (1 + len(subject.columns)), *subject.rows]
    return "\n".join([
        *([f"## {subject.part}\n"] if subject.part else []),
        f'<a id="{subject.anchor}"></a>\n\n### {subject.title}\n',
        *([f"{subject.text}\n"] if subject.text else []),
        *(f"|{'|'.join(_fill_line(subject, line, records))}|" for line in lines),
        f"\nMeasured: {'; '.join(sources)}.\n",
    ])  # fmt: skip


def _fill_line(subject: Subject, line: Sequence[str], records: Mapping[str, Record]) -> list[str]:
    """The cells of a line; of a measure that ends in an arrow the best are bold."""
    cells = [fill_cell(cell, records) for cell in line]
    if cells[0][-1] not in BEST:
        return cells
    competes = [False, *(name != GOAL and not name.startswith("(") for name in subject.columns)]
    values = [float(cell.replace(",", "")) if ok and cell else None for cell, ok in zip(cells, competes, strict=True)]
    best = BEST[cells[0][-1]](value for value in values if value is not None)
    return [f"**{cell}**" if value == best else cell for cell, value in zip(cells, values, strict=True)]


def _as_of_record(name: str, measured: Measured, record: Record, changes: Mapping[str, list[str]] | None) -> str:
    place = f"{RECORDS}/{name}.json"
    if measured.again:
        return f"[every test run]({place})"
    load = f", load {record.load[0]:.0f}" if measured.timed else ""
    if changes is None:
        return f"[{record.date}]({place}){load}"
    return f"[{record.date}]({place}){load}, {'code changed since' if changes.get(name) else 'this code'}"
