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
from benchmarks.figures.rows import Measured, Rows, Subject, fill_cell, read_rows
from facade_core.core.errors import InputError
from tasks.engine.stage_code import ROOT

ROWS = read_rows()
AGAIN = [name for name, measured in ROWS.measured.items() if measured.again]


def test_the_page_is_what_rows_and_records_give() -> None:
    assert PAGE.read_text(encoding="utf-8") == current(), "write it with: make figures"


def find_figure_links(page: Path) -> list[tuple[str, str]]:
    """The links to subjects of a page: text and anchor."""
    return re.findall(r"\[([^\]]*)\]\([\w./]*figures\.md#(\w+)\)", page.read_text(encoding="utf-8"))


def cells(subject: Subject, records: dict[str, Record]) -> str:
    return "|".join(fill_cell(cell, records) for row in subject.rows for cell in row[1:])


def numbers(text: str) -> list[str]:
    return re.findall(r"[\d.,]*\d", text)


@pytest.mark.parametrize(
    "page", [ROOT / "README.md", *sorted((ROOT / "docs" / "stages").glob("*.md"))], ids=lambda page: page.stem
)
def test_figures_on_pages_are_those_of_their_subjects(page: Path) -> None:
    figures = {subject.anchor: cells(subject, kept(ROWS)) for subject in ROWS.subjects}
    for text, anchor in find_figure_links(page):
        assert anchor in figures, f"{page.name}: no subject has the anchor {anchor}"
        assert set(numbers(text)) <= set(numbers(figures[anchor])), f"{page.name}: {text}"


@pytest.mark.parametrize("page", sorted((ROOT / "docs" / "stages").glob("*.md")), ids=lambda page: page.stem)
def test_each_figure_of_a_stage_is_a_link_to_its_subject(page: Path) -> None:
    _, header, table = page.read_text(encoding="utf-8").partition("|figures|")
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


@pytest.mark.long
@pytest.mark.parametrize("name", AGAIN)
def test_a_figure_that_is_quick_to_measure_is_measured_again(name: str, data: Path) -> None:
    """And stands on the page as it is: only time may differ, which such a row does not tell."""
    before = kept(ROWS)
    now = before | {name: measure(ROWS.measured[name].command, {"DIR": str(data)})}
    for subject in (subject for subject in ROWS.subjects if name in subject.records):
        assert cells(subject, now) == cells(subject, before), f"measure it again: python -m benchmarks.figures {name}"


def record(**values: object) -> Record:
    machine = {"cores": 2, "system": "Linux x86_64", "python": "3.11"}
    return Record("streetloom bench query", "2026-11-25", machine, (5.4, 6.0), 60.0, {"catalogs.query": "00"}, values)


def test_values_stand_in_the_text_as_it_says() -> None:
    found = record(
        share=0.9187, seconds=0.457, count=4984, each=[1, 4, 7], blocks=[{"name": "a", "n": 3}, {"name": "b", "n": 5}]
    )
    text = "{q/share!percent:.1f}, {q/seconds:.2f}, {q/seconds:0.2f}; {q/count:,}; {q/each!count}; {q/blocks/b/n}"
    assert fill_cell(text, {"q": found}) == "91.9, .46, 0.46; 4,984; 3; 5"
    for missing in ("{q/nothing}", "{q/blocks/c/n}", "{q/each}", "{other/share}"):
        with pytest.raises(InputError, match=re.escape(missing)):
            fill_cell(missing, {"q": found})


def subject(cell: str, judged: date | None = None, command: str | None = None) -> Subject:
    return Subject("Filter", "filter", ("ours",), (("time", cell),), judged=judged, command=command)


def test_the_page_says_what_vouches_for_a_figure() -> None:
    measured = {"q": Measured("streetloom bench query", timed=True), "quick": Measured("...", again=True)}
    records = {"q": record(seconds=0.457), "quick": record(count=3)}
    day, place = date(2026, 11, 23), "../benchmarks/figures/records"
    for one, cell, source in (
        (subject("{q/seconds:.2f} s"), "|.46 s|", f"[2026-11-25]({place}/q.json), load 5: `streetloom bench query`."),
        (subject("{quick/count}"), "|3|", f"[every test run]({place}/quick.json): `"),
        (subject("24", day, "streetloom bench layout"), "|24|", "by eye, 2026-11-23: `streetloom bench layout`."),
    ):
        page = rendered(Rows((one,), measured), records)
        assert cell in page
        assert source in page


def test_the_best_of_a_row_is_bold_where_an_arrow_says_what_is_best() -> None:
    columns = ("ours", "theirs", "(the bound)", "goal")
    rows = (
        ("PSNR ↑", "{q/a}", "{q/b}", "{q/c}", "9"),
        ("time ↓", "{q/a}", "{q/b}", "", ""),
        ("size", "{q/a}", "", "", ""),
    )
    one = Subject("Filter", "filter", columns, rows)
    page = rendered(Rows((one,), {"q": Measured("streetloom bench query")}), {"q": record(a=1, b=2, c=3)})
    assert "|PSNR ↑|1|**2**|3|9|\n|time ↓|**1**|2|||\n|size|1||||\n" in page


def test_the_site_says_whether_code_has_changed_since() -> None:
    rows = Rows((subject("{q/seconds:.2f} s"),), {"q": Measured("streetloom bench query")})
    found = {"q": record(seconds=0.457)}
    assert "q.json), this code: `" in rendered(rows, found, {})
    assert "q.json), code changed since: `" in rendered(rows, found, {"q": ["a.b"]})


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
    "lines",
    [
        "rows = [['time', '46 s']]\ncommand = 'make demo'",  # typed, and by nobody
        "rows = [['time', '46 s']]\njudged = 2026-11-24",  # by no command
        "rows = [['time', '{other/seconds}']]",
        "rows = [['time', 'all']]",  # of nothing
        "rows = [['time', '{q/seconds}', '{q/seconds}']]",  # a cell too many
        "rows = [['time', '{q/seconds}']]\n[[subject]]\ntitle = 'again'\nanchor = 'same'\ncolumns = []\nrows = []",
    ],
)
def test_a_subject_that_nothing_vouches_for_is_refused(lines: str, tmp_path: Path) -> None:
    path = tmp_path / "rows.toml"
    path.write_text(
        "[record.q]\ncommand = 'streetloom bench query'\n\n"
        f"[[subject]]\ntitle = 'seconds'\nanchor = 'same'\ncolumns = ['ours']\n{lines}\n"
    )
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
