"""Ids, names of streets and photos, and reasons that attack whoever shows them, in all that is written, served and printed."""

from __future__ import annotations

import html
import io
import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import unquote, urljoin, urlparse

import pandas as pd
import pytest
from click.testing import CliRunner
from rich.console import Console

from catalogs.printable_text import escape_invisible, escape_invisible_json
from catalogs.query.execution import query
from catalogs.stac.catalog import write_catalog
from flows import artifacts, console
from flows.cli import commands as cli
from flows.markdown import escape_markdown, markdown_code
from tasks.engine.outcome import log_units
from tasks.export.formats import export_run
from tasks.viewing.run_view import RunReader
from tests.exports import EACH, READERS
from tests.faults.hostile_names import BROKEN, CONTROLS, DATA, MARKUP, hostile_block


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimpleNamespace]:
    with hostile_block(tmp_path_factory.mktemp("hostile")) as block:
        yield block


def printable(text: str) -> bool:
    """Whether no character steers a terminal, line breaks aside."""
    return all(escape_invisible(line) == line for line in text.split("\n"))


def items(made: SimpleNamespace) -> pd.DataFrame:
    return query(made.out)


def test_the_catalogue_holds_every_name_as_it_is(made: SimpleNamespace) -> None:
    rows = items(made)
    facades = rows[rows.kind == "facade"]
    assert sorted(facades[facades.role == "street"].building) == sorted(made.names)
    assert set(facades.building) == set(made.names)
    assert (facades.status == "done").all()
    assert set(facades.street) == {("street " + name)[:200] for name in (MARKUP, CONTROLS + DATA)}
    for name in made.names:
        quoted = name.replace("'", "''")
        assert list(query(made.out, where=f"building = '{quoted}' and role = 'street'").building) == [name]
    [aside] = rows[rows.kind == "exemplar"].itertuples()
    assert aside.id == BROKEN
    assert aside.status == "refused"
    assert list(rows[rows.photo > 0].building) == [CONTROLS]


def test_the_report_runs_and_shows_nothing_of_others(made: SimpleNamespace) -> None:
    from lxml import html as parser

    templates = Path(artifacts.__file__).parents[1] / "catalogs" / "published"
    known = {tag for path in templates.glob("*.j2") for tag in re.findall(r"<([a-z]\w*)", path.read_text())}
    shown = {}
    for path in (made.published / "report").rglob("*.html"):
        text = path.read_text("utf-8")
        assert printable(text)
        page = parser.document_fromstring(text)
        tags = {element.tag for element in page.iter() if isinstance(element.tag, str)}
        assert tags <= known | {"tbody"}
        for element in page.iter():
            names = set(map(str, element.attrib))
            assert not any(name.startswith("on") or name == "style" for name in names), names
            for name in ("src", "href"):
                if address := element.get(name):
                    place = urlparse(address)
                    assert not place.scheme
                    assert (path.parent / unquote(place.path)).is_file(), address
        shown[path] = page.text_content()
        [policy] = [e.get("content") for e in page.iter("meta") if e.get("http-equiv") == "Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
    index = shown.pop(made.published / "report" / "index.html")
    for name in made.names:
        assert sum(f"{escape_invisible(name)}-0" in page for page in shown.values()) == 1
    assert escape_invisible(BROKEN) in index
    assert "49" not in index[index.index("{{ 7*7 }}") :][:9]


def test_stac_leads_to_every_unit_and_nowhere_else(made: SimpleNamespace) -> None:
    import pystac

    files = [*(made.published / "stac").rglob("*.json"), made.out / "catalog.json"]
    ids = set()
    for path in files:
        value = json.loads(path.read_text("utf-8"))
        ids.add(value["id"])
        for link in [*value["links"], *value.get("assets", {}).values()]:
            address = urlparse(urljoin(path.as_uri(), link["href"]))
            if address.scheme == "file":
                target = Path(unquote(address.path))
                assert target.exists(), link["href"]
                assert target.is_relative_to(made.top)
    assert {f"{name}-0" for name in made.names} <= ids
    items = pystac.Catalog.from_file(made.out / "catalog.json").get_items(recursive=True)
    assert {f"{name}-0" for name in made.names} <= {item.id for item in items}


def test_a_catalogue_leads_to_runs_of_any_name(made: SimpleNamespace) -> None:
    top = made.top / "exports" / "runs"
    for name in ("a b", "50%23#1?x=<b>"):
        shutil.copytree(made.out, top / name, ignore=shutil.ignore_patterns("store", "report"))
    for link in json.loads(write_catalog(top).read_text("utf-8"))["links"]:
        address = urlparse(urljoin((top / "catalog.json").as_uri(), link["href"]))
        assert (address.query, address.fragment) == ("", "")
        assert Path(unquote(address.path)).is_file(), link["href"]


@pytest.mark.parametrize("format", EACH)
def test_exports_name_things_as_they_are(format: str, made: SimpleNamespace) -> None:
    target = made.top / "exports" / format
    export_run(made.out, format, target)
    found = READERS[format].names(target)
    if format == "labelme":
        assert len(found) == (items(made).kind == "facade").sum()
    elif format == "obj":  # a name ends at white space
        assert found == {re.sub(r"\s+", "_", escape_invisible(name)) for name in made.names}
    elif format == "citygml":  # XML cannot have them all as they are
        assert found == {escape_invisible(name).replace("\ufffe", "\\ufffe") for name in made.names}
    elif format in ("coco", "cog"):
        assert {facade.rpartition("-")[0] for facade in found} == set(made.names)
    else:
        assert found == set(made.names)
    for path in target.rglob("*"):
        assert path.resolve().is_relative_to(target)
        assert escape_invisible(path.name) == path.name
        assert not path.name.startswith(".") or path.name == ".export.json"  # LabelMe's marker, no picture's
        if path.suffix in (".json", ".jsonl"):
            assert printable(path.read_text("utf-8")), path.name


def test_the_viewer_serves_names_as_data(made: SimpleNamespace) -> None:
    from starlette.testclient import TestClient

    from flows.viewer.app import create_application

    client = TestClient(create_application(RunReader(made.out), "127.0.0.1", "127.0.0.1"), base_url="http://127.0.0.1")
    block = client.get("/api/block").json()
    assert {facade["building"] for facade in block["facades"]} == set(made.names)
    for facade in block["facades"]:
        answer = client.get("/api/facade", params={"id": facade["id"]})
        assert answer.headers["content-type"] == "application/json"
        assert answer.headers["x-content-type-options"] == "nosniff"
        stage = answer.json()["stages"][-1]["stage"]
        image = client.get("/picture/facade", params={"id": facade["id"], "stage": stage})
        assert image.headers["content-type"] == "image/webp"
    for address in ("/page/..%2fapp.py", "/page/%2e%2e/app.py", "/page//etc/passwd", "/page/..\\app.py", "/page/%00"):
        assert client.get(address).status_code == 404, address
    for parameters in ({"id": "\0"}, {"id": "../../store"}, {}, {"id": block["facades"][0]["id"], "stage": "../../x"}):
        assert client.get("/picture/facade", params=parameters).status_code == 404, parameters


def test_artifacts_show_the_text_alone(made: SimpleNamespace, monkeypatch: pytest.MonkeyPatch) -> None:
    from markdown_it import MarkdownIt

    written: list[Any] = []
    for kind in ("table", "link", "markdown"):
        monkeypatch.setattr(artifacts, f"create_{kind}_artifact", lambda *what, **more: written.append((what, more)))
    failures = [{"unit": name, "reason": f"{name}: is broken; mend it"} for name in made.names]
    counts = {"units_done": 1, "units_skipped": 0, "failures": failures, "refused": [], "out": str(made.out)}
    artifacts.publish_outcome(made.run, made.summary | counts)
    artifacts.publish_viewer_link(made.run)
    reader = MarkdownIt("commonmark", {"html": True}).enable(["table", "strikethrough"])

    def renders(text: str) -> str:
        return html.unescape(reader.render(text)).strip()

    [shown] = [what[0] for what, more in written if more["key"] == "small-failures"]
    for row, failure in zip(shown, failures, strict=True):
        for key in ("unit", "reason"):
            assert renders(row[key]) == f"<p>{escape_invisible(failure[key]).strip()}</p>"
            assert "<" not in re.sub(r"</?p>", "", reader.render(row[key]))
    live = re.compile(r"(?<!\\)<[a-z!/]|(?<![\\!])\]\((?!file:|http://127)", re.IGNORECASE)
    assert not live.search(
        json.dumps([[what, more["description"]] for what, more in written if what]).replace("\\\\", "\\")
    )
    for name in made.names:
        assert f"<p><code>{escape_invisible(name)}</code></p>" == renders(markdown_code(name)) or "`" in name
        assert not re.search(r"https?://|www\.|\w@", escape_markdown(name))  # what a UI makes links of by itself


def test_terminals_are_not_steered(made: SimpleNamespace, caplog: pytest.LogCaptureFixture) -> None:
    log_units("facades", [{"unit": CONTROLS, "status": status, "reason": CONTROLS} for status in ("failed", "done")])
    assert caplog.messages
    assert all(map(printable, caplog.messages))
    assert {record.unit for record in caplog.records} == {CONTROLS}
    failures = [{"unit": name, "reason": f"{name}: is broken; mend it"} for name in [*made.names, "[/red]", "\ud800"]]
    drawn = io.StringIO()
    summary = made.summary | {"failures": failures, "refused": [], "seconds": 1.0, "units_skipped": 0}
    summary |= {"out": str(made.out)}
    console.print_summary(Console(file=drawn, force_terminal=True, width=80), summary)
    shown = re.sub(r"\x1b\[[\d;]*m", "", drawn.getvalue())  # its own colours
    assert printable(shown)
    for failure in failures:
        assert f"failed {escape_invisible(failure['unit'])}: {escape_invisible(failure['reason'])}" in shown
    for arguments in (
        ["query", str(made.out)],
        ["query", str(made.out), "--format", "json"],
        ["query", str(made.out), "--format", "geojson"],
        ["query", str(made.out), "--where", f"id = '{CONTROLS}"],
        [
            "export",
            str(made.out),
            "--format",
            "coco",
            "--building",
            CONTROLS,
            "--to",
            str(made.top / "exports" / "\x1b[31m"),
        ],
        ["export", str(made.out), "--format", "coco", "--building", "\x1b[31mno such\u202e"],
        ["view", str(made.top / "in" / "photos"), "--no-open"],
    ):
        done = CliRunner().invoke(cli.command_line, arguments)
        assert not isinstance(done.exception, Exception), arguments
        assert printable(done.output), arguments
    found = CliRunner().invoke(cli.command_line, ["query", str(made.out), "--format", "json"]).output
    assert {row["building"] for row in json.loads(found) if row["kind"] == "facade"} == set(made.names)


def test_what_is_visible() -> None:
    assert escape_invisible("Straße 7, Café \u200d\u00a0") == "Straße 7, Café \u200d\u00a0"
    assert escape_invisible("a\x1b\u202e\u2028\ud800\U000e0041\r\n") == "a\\x1b\\u202e\\u2028\\ud800\\U000e0041\\r\\n"
    for text in (MARKUP, CONTROLS, DATA, "\U000e0041\ud800"):
        assert json.loads(escape_invisible_json(json.dumps([text], indent=1, ensure_ascii=False))) == [text]
