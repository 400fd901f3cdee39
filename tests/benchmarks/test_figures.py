"""The page of figures is what its rows and records give; what is quick is measured again."""

from __future__ import annotations

import json
from datetime import date
from pathlib import Path

import pytest

from benchmarks.figures.code import changed, code_of
from benchmarks.figures.page import PAGE, current, kept, rendered
from benchmarks.figures.records import FOLDER, Record, measure
from benchmarks.figures.rows import Measured, Row, Rows, figure_of, read_rows
from facade_core.core.errors import InputError

# The day since which figures come with a record: none is carried over by hand after it.
RECORDS_SINCE = date(2026, 11, 25)
ROWS = read_rows()
AGAIN = [name for name, measured in ROWS.measured.items() if measured.again]


def test_the_page_is_what_rows_and_records_give() -> None:
    assert PAGE.read_text(encoding="utf-8") == current(), "write it with: make figures"


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


@pytest.mark.parametrize(
    "row",
    [
        "figure = '46 s'\ncommand = 'make demo'",  # typed, and by nobody
        "figure = '46 s'\nby = 'hand'\ncommand = 'make demo'",  # of no day
        "figure = '46 s'\nby = 'guess'\nof = 2026-11-24\ncommand = 'make demo'",
        "figure = '{other/seconds}'",
        "figure = 'all'",  # of nothing
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
    readers, run = code_of("streetloom bench readers --data DIR"), code_of("streetloom bench block")
    assert {"benchmarks.readers", "catalogs.readers", "facade_core.geometry"} <= readers.keys()
    assert "flows.viewer" not in readers
    assert {"benchmarks.block", "tasks.stages", "facade_core.facade", "flows.block"} <= run.keys()  # it starts a run
    assert changed(readers, readers | {"facade_core.geometry": "00", "flows.viewer": "00"}) == [
        "facade_core.geometry",
        "flows.viewer",
    ]
