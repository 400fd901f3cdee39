"""The page of figures is what its rows and records give; what is quick is measured again."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from datetime import date
from pathlib import Path

import pytest

from benchmarks.figures.__main__ import main as write_figures
from benchmarks.figures.code import changed, code_of
from benchmarks.figures.page import PAGE, current, kept, rendered
from benchmarks.figures.records import FOLDER, Record, measure
from benchmarks.figures.rows import Measured, Row, Rows, figure_of, read_rows
from facade_core.core.errors import InputError
from tasks.engine.stage_code import ROOT

# The day since which figures come with a record: none is carried over by hand after it.
RECORDS_SINCE = date(2026, 11, 25)
ROWS = read_rows()
AGAIN = [name for name, measured in ROWS.measured.items() if measured.again]


def test_the_page_is_what_rows_and_records_give() -> None:
    assert PAGE.read_text(encoding="utf-8") == current(), "write it with: make figures"


def find_figure_links(page: Path) -> list[tuple[str, str]]:
    """The links to rows in the tables of a page: text and anchor."""
    return re.findall(r"\[([^\]]*)\]\([\w./]*figures\.md#(\w+)\)", page.read_text(encoding="utf-8"))


def numbers(text: str) -> list[str]:
    return re.findall(r"[\d.,]*\d", text)


@pytest.mark.parametrize(
    "page", [ROOT / "README.md", *sorted((ROOT / "docs" / "stages").glob("*.md"))], ids=lambda page: page.stem
)
def test_figures_on_pages_are_those_of_their_rows(page: Path) -> None:
    figures = {row.anchor: figure_of(row, kept(ROWS)) for row in ROWS.rows if row.anchor}
    for text, anchor in find_figure_links(page):
        assert anchor in figures, f"{page.name}: no row has the anchor {anchor}"
        left = iter(numbers(figures[anchor]))
        assert all(number in left for number in numbers(text)), f"{page.name}: {text}"


@pytest.mark.parametrize("page", sorted((ROOT / "docs" / "stages").glob("*.md")), ids=lambda page: page.stem)
def test_each_figure_of_a_stage_is_a_link_to_its_row(page: Path) -> None:
    _, header, table = page.read_text(encoding="utf-8").partition("| figures |")
    assert header or "figures.md#" not in page.read_text(encoding="utf-8"), f"{page.name}: no table of figures"
    rows = [line for line in table.partition("\n\n")[0].splitlines()[2:] if line.startswith("|")]
    assert [row for row in rows if "figures.md#" not in row.split("|")[2]] == []


def test_readme_has_at_most_eight_figures() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8").partition("## Figures")[2].partition("## ")[0]
    rows = [line for line in text.splitlines() if line.startswith("| ") and line.strip("| ")]
    assert sum(len(numbers(row.rsplit("|", 2)[1].partition("](")[0])) for row in rows) <= 8


def test_records_are_of_their_commands_and_each_is_on_the_page() -> None:
    records = kept(ROWS)
    assert {path.stem for path in FOLDER.glob("*.json")} == records.keys() == ROWS.measured.keys()
    assert {name: one.command for name, one in records.items()} == {n: one.command for n, one in ROWS.measured.items()}
    for name, record in records.items():
        told = json.dumps(record.values)
        assert not [place for place in ("/home/", "/tmp/", "/work/", "/root/") if place in told], name


def test_what_is_new_has_a_record() -> None:
    assert [row.what for row in ROWS.rows if row.by == "hand" and row.of and row.of > RECORDS_SINCE] == []


@pytest.mark.long
@pytest.mark.parametrize("name", AGAIN)
def test_a_figure_that_is_quick_to_measure_is_measured_again(name: str, data: Path) -> None:
    """And stands on the page as it is: only time may differ, which such a row does not tell."""
    before = kept(ROWS)
    now = before | {name: measure(ROWS.measured[name].command, {"DIR": str(data)})}
    for row in (row for row in ROWS.rows if name in row.records):
        assert figure_of(row, now) == figure_of(row, before), f"measure it again: python -m benchmarks.figures {name}"


def record(**values: object) -> Record:
    machine = {"cores": 2, "system": "Linux x86_64", "python": "3.11"}
    return Record("streetloom bench query", "2026-11-25", machine, (5.4, 6.0), 60.0, {"catalogs.query": "00"}, values)


def test_values_stand_in_the_text_as_it_says() -> None:
    found = record(
        share=0.9187, seconds=0.457, count=4984, each=[1, 4, 7], blocks=[{"name": "a", "n": 3}, {"name": "b", "n": 5}]
    )
    text = "{q/share!percent:.1f}, {q/seconds:.2f}, {q/seconds:0.2f}; {q/count:,}; {q/each!max}; {q/blocks/b/n}, {q/blocks/0/1}"
    assert figure_of(Row("what", text), {"q": found}) == "91.9, .46, 0.46; 4,984; 7; 5, 3"
    for missing in ("{q/nothing}", "{q/blocks/c/n}", "{q/each}", "{other/share}"):
        with pytest.raises(InputError, match="what: "):
            figure_of(Row("what", missing), {"q": found})


def test_the_page_says_what_vouches_for_a_figure() -> None:
    rows = (
        Row("a filter", "{q/seconds:.2f} s (.9)", "hand", date(2026, 11, 24)),
        Row("blocks", "{quick/count}"),
        Row("plausible", "24", "eye", date(2026, 11, 23), "streetloom bench layout"),
    )
    measured = {"q": Measured("streetloom bench query", timed=True), "quick": Measured("...", again=True)}
    lines = rendered(Rows(rows, measured), {"q": record(seconds=0.457), "quick": record(count=3)}).splitlines()[-3:]
    place = "../benchmarks/figures/records"
    assert f"| .46 s (.9) | [2026-11-25]({place}/q.json), load 5; the rest by hand, 2026-11-24 |" in lines[0]
    assert f"| 3 | [every test run]({place}/quick.json) |" in lines[1]
    assert "| 24 | by eye, 2026-11-23 | `streetloom bench layout` |" in lines[2]


def test_the_site_says_what_has_changed_since() -> None:
    rows = Rows((Row("a filter", "{q/seconds:.2f} s"),), {"q": Measured("streetloom bench query")})
    found = {"q": record(seconds=0.457)}
    for rooms, said in {
        (): ", this code |",
        ("a.b",): "; changed since: `a.b` |",
        tuple("abcde"): "; changed since: `a`, `b`, `c` and 2 more |",
    }.items():
        assert said in rendered(rows, found, {"q": list(rooms)} if rooms else {})


def test_a_night_measures_the_quickest_that_are_due_and_fit(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    commands = {name: f"streetloom bench {name}" for name in ("long", "quick", "broken", "fresh")}
    seconds = {"long": 9000.0, "quick": 60.0, "broken": 30.0, "fresh": 1.0}
    rows = Rows((), {name: Measured(command) for name, command in commands.items()})
    records = {name: replace(record(), seconds=seconds[name]) for name in commands}
    tried: list[str] = []

    def again(command: str, places: dict[str, str]) -> Record:
        assert places == {"DIR": "data"}
        tried.append(command)
        if command == commands["broken"]:
            raise InputError("no data")
        return record()

    made: list[str] = []
    page = tmp_path / "figures.md"
    for name, value in {
        "read_rows": lambda: rows, "kept": lambda rows: records, "due": lambda kept: dict.fromkeys(["long", "quick", "broken"]),
        "measure": again, "write_record": lambda name, record: made.append(name), "current": lambda: "page", "PAGE": page,
    }.items():  # fmt: skip
        monkeypatch.setattr(f"benchmarks.figures.__main__.{name}", value)
    monkeypatch.setattr("sys.argv", ["figures", "--night", "1", "DIR=data"])
    write_figures()
    assert tried == [commands["broken"], commands["quick"]]
    assert (made, page.read_text()) == (["quick"], "page")


@pytest.mark.parametrize(
    "row",
    [
        "figure = '46 s'\ncommand = 'make demo'",  # typed, and by nobody
        "figure = '46 s'\nby = 'hand'\ncommand = 'make demo'",  # of no day
        "figure = '46 s'\nby = 'guess'\nof = 2026-11-24\ncommand = 'make demo'",
        "figure = '{other/seconds}'",
        "figure = 'all'",  # of nothing
        "figure = '{q/seconds}'\nanchor = 'same'\n\n[[row]]\nwhat = 'again'\nfigure = '{q/seconds}'\nanchor = 'same'",
    ],
)
def test_a_row_that_nothing_vouches_for_is_refused(row: str, tmp_path: Path) -> None:
    path = tmp_path / "rows.toml"
    path.write_text(f"[record.q]\ncommand = 'streetloom bench query'\n\n[[row]]\nwhat = 'seconds'\n{row}\n")
    with pytest.raises(InputError, match="seconds"):
        read_rows(path)


def test_a_record_keeps_names_for_places_and_needs_them(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="say what DIR is"):
        measure("python -m benchmarks.figures DIR", {})
    with pytest.raises(InputError, match="without JSON"):
        measure("python --version DIR", {"DIR": str(tmp_path)})
    (tmp_path / "said.json").write_text(json.dumps({"folder": str(tmp_path)}))
    made = measure(
        "python -c 'import sys; print(open(sys.argv[1] + \"/said.json\").read())' DIR", {"DIR": str(tmp_path)}
    )
    assert made.values == {"folder": "DIR"}
    assert "DIR" in made.command


def test_the_code_of_a_record_is_what_its_command_reaches() -> None:
    readers, run = code_of("streetloom bench readers --data DIR"), code_of("streetloom bench demo_time")
    assert {"benchmarks.readers", "catalogs.readers", "facade_core.geometry"} <= readers.keys()
    assert "flows.viewer" not in readers
    assert {
        "benchmarks.demo_time",
        "tasks.stages",
        "facade_core.facade",
        "flows.block",
    } <= run.keys()  # it starts a run
    assert changed(readers, readers | {"facade_core.geometry": "00", "flows.viewer": "00"}) == [
        "facade_core.geometry",
        "flows.viewer",
    ]
